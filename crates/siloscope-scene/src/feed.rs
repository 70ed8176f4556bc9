//! The feed: a height field over the cone's vertex, made of a base shape, a tilt, lumps and ratholes.

use crate::hit::{Hit, Label};
use crate::limits::bounded;
use crate::random::Stream;
use crate::root::{Probe, first_crossing};
use crate::silo::Silo;
use siloscope::{Result, Vec3};

/// The base shape; heights fall away from (or rise about) the shape's centre.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Base {
    /// A plane.
    Flat,
    /// The paper's `-0.75 R (1 - exp(-r²/R²))` (section 2.4.1).
    Gaussian,
    /// A cone of the angle whose tangent is given, rounded over the second number's radius: positive tangents make
    /// a funnel, negative ones a mound.
    Conical(f64, f64),
    /// A crater in a plain: a funnel as by the first two numbers, as deep as the third below the plain, its rim
    /// rounded over the fourth.
    Crater(f64, f64, f64, f64),
}

/// Smooth random bumps: a bicubic B-spline with random coefficients on a square lattice.
#[derive(Debug, Clone, PartialEq)]
pub struct Lumps {
    height: f64,
    pitch: f64,
    reach: f64,
    side: usize,
    coefficients: Vec<f64>,
}

/// A steep hole: `depth · exp(-(r/radius)⁴)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rathole {
    /// Its axis.
    pub centre: [f64; 2],
    /// Radius at which 63 % of the depth is gone.
    pub radius: f64,
    /// Depth at its axis.
    pub depth: f64,
}

/// Radii beyond which exp(-(r/radius)⁴) is taken as 0: there it is below 1e-17.
const RATHOLE_REACH: f64 = 2.51;

/// Feed whose highest point is `level` of the silo's height above the vertex.
#[derive(Debug, Clone)]
pub struct Feed {
    /// Share of cylinder and cone height at which the highest feed point lies.
    pub level: f64,
    pub(crate) shape: Shape,
    /// Height over the vertex that the shape's zero has.
    pub(crate) offset: f64,
    pub(crate) silo: Silo,
    steepness: f64,
}

/// The feed's shape, its zero anywhere.
#[derive(Debug, Clone)]
pub struct Shape {
    /// Radius of the silo.
    pub radius: f64,
    /// Base shape.
    pub base: Base,
    /// Where the base shape has its axis.
    pub centre: [f64; 2],
    /// Slopes along x and y.
    pub tilt: [f64; 2],
    /// Random bumps.
    pub lumps: Option<Lumps>,
    /// Steep holes.
    pub ratholes: Vec<Rathole>,
}

/// Height and its derivatives along x and y.
type Jet = [f64; 3];

fn add(a: Jet, b: Jet) -> Jet {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

impl Base {
    fn jet(&self, x: f64, y: f64, radius: f64) -> Jet {
        match *self {
            Base::Flat => [0.0; 3],
            Base::Gaussian => {
                let r2 = radius * radius;
                let bell = (-(x * x + y * y) / r2).exp();
                let slope = -1.5 / radius * bell;
                [-0.75 * radius * (1.0 - bell), slope * x, slope * y]
            }
            Base::Conical(tangent, tip) => {
                let rounded = (x * x + y * y + tip * tip).sqrt();
                [tangent * (rounded - tip), tangent * x / rounded, tangent * y / rounded]
            }
            Base::Crater(tangent, tip, depth, edge) => {
                let rounded = (x * x + y * y + tip * tip).sqrt();
                let cone = tangent * (rounded - tip) - depth;
                let smooth = cone.hypot(edge);
                let turn = 0.5 * (1.0 - cone / smooth) * tangent / rounded;
                [0.5 * (cone - smooth), turn * x, turn * y]
            }
        }
    }

    /// Bound of the slopes; the Gaussian's is 0.75·√2·exp(-1/2).
    fn steepness(&self) -> f64 {
        match *self {
            Base::Flat => 0.0,
            Base::Gaussian => 0.6434,
            Base::Conical(tangent, _) | Base::Crater(tangent, ..) => tangent.abs(),
        }
    }

    /// Bound of the second derivatives.
    fn bend(&self, radius: f64) -> f64 {
        match *self {
            Base::Flat => 0.0,
            Base::Gaussian => 1.5 / radius,
            Base::Conical(tangent, tip) => tangent.abs() / tip,
            Base::Crater(tangent, tip, _, edge) => tangent.abs() / tip + 0.5 * tangent * tangent / edge,
        }
    }
}

impl Lumps {
    /// Bumps of at most `height` metres up or down, about `pitch` metres apart, over a disc of `reach`.
    pub fn new(height: f64, pitch: f64, reach: f64, seed: u64) -> Result<Self> {
        bounded("lump_height", height, 0.0, reach, "between 0 and the silo's radius")?;
        bounded("lump_size", pitch, 0.01 * reach, 100.0 * reach, "between 0.01 and 100 silo radii")?;
        let side = (2.0 * reach / pitch).ceil() as usize + 5;
        let stream = Stream::new(seed, 0x1u64);
        let coefficients = (0..side * side).map(|i| height * (2.0 * stream.uniform(i as u64) - 1.0)).collect();
        Ok(Self { height, pitch, reach, side, coefficients })
    }

    fn jet(&self, x: f64, y: f64) -> Jet {
        let (column, u) = self.cell(x);
        let (row, v) = self.cell(y);
        let (wx, sx, wy, sy) = (spline(u), spline_slope(u), spline(v), spline_slope(v));
        let mut jet = [0.0; 3];
        for j in 0..4 {
            let line = self.coefficients.get((row + j) * self.side + column..).unwrap_or(&[]);
            for (i, c) in line.iter().take(4).enumerate() {
                jet[0] += c * wx[i] * wy[j];
                jet[1] += c * sx[i] * wy[j] / self.pitch;
                jet[2] += c * wx[i] * sy[j] / self.pitch;
            }
        }
        jet
    }

    /// Lattice cell of a coordinate and the place in it; outside the lattice the edge cell.
    fn cell(&self, x: f64) -> (usize, f64) {
        let s = ((x + self.reach) / self.pitch + 0.5).clamp(0.0, (self.side - 4) as f64);
        let cell = s.floor().min((self.side - 4) as f64);
        (cell as usize, s - cell)
    }

    /// Bound of the slopes: the weights of f_x and of f_y add up to at most 1.5.
    fn steepness(&self) -> f64 {
        1.5 * std::f64::consts::SQRT_2 * self.height / self.pitch
    }

    /// Bound of the second derivatives: the weights of f_xx add up to at most 4, those of f_xy to 2.25.
    fn bend(&self) -> f64 {
        6.25 * self.height / (self.pitch * self.pitch)
    }
}

/// Weights of the uniform cubic B-spline.
pub(crate) fn spline(u: f64) -> [f64; 4] {
    let v = 1.0 - u;
    [
        v * v * v / 6.0,
        (3.0 * u * u * u - 6.0 * u * u + 4.0) / 6.0,
        (3.0 * v * v * v - 6.0 * v * v + 4.0) / 6.0,
        u * u * u / 6.0,
    ]
}

fn spline_slope(u: f64) -> [f64; 4] {
    let v = 1.0 - u;
    [-v * v / 2.0, (3.0 * u - 4.0) * u / 2.0, (4.0 - 3.0 * v) * v / 2.0, u * u / 2.0]
}

impl Rathole {
    /// Checks its lengths.
    pub fn validate(&self, silo_radius: f64) -> Result<()> {
        bounded("rathole_radius", self.radius, 0.01 * silo_radius, silo_radius, "between 0.01 and 1 silo radii")?;
        bounded("rathole_depth", self.depth, 0.0, 1e3, "between 0 and 1000 m")?;
        let reach = self.centre[0].hypot(self.centre[1]);
        bounded("rathole_centre", reach, 0.0, silo_radius, "within the silo")
    }

    fn jet(&self, x: f64, y: f64) -> Jet {
        let (dx, dy) = (x - self.centre[0], y - self.centre[1]);
        let w2 = self.radius * self.radius;
        let q = (dx * dx + dy * dy) / w2;
        if q > RATHOLE_REACH * RATHOLE_REACH {
            return [0.0; 3];
        }
        let drop = self.depth * (-q * q).exp();
        let slope = 4.0 * q * drop / w2;
        [-drop, slope * dx, slope * dy]
    }

    /// Distance from its axis beyond which it is not there.
    fn reach(&self) -> f64 {
        RATHOLE_REACH * self.radius
    }

    /// Bound of the slopes: 4 q^1.5 exp(-q²) stays below 1.53.
    fn steepness(&self) -> f64 {
        1.53 * self.depth / self.radius
    }

    /// Bound of the second derivatives: |16 q³ - 12 q| exp(-q²) stays below 3.4 and 4 q exp(-q²) below 1.72.
    fn bend(&self) -> f64 {
        3.4 * self.depth / (self.radius * self.radius)
    }
}

impl Shape {
    /// Checks slopes and holes.
    pub fn validate(&self) -> Result<()> {
        if let Base::Crater(_, _, depth, edge) = self.base {
            bounded("crater_depth", depth, 0.0, 1e3, "between 0 and 1000 m")?;
            bounded("tip", edge, 1e-4 * self.radius, 1e3, "at least 0.0001 silo radii")?;
        }
        if let Base::Conical(tangent, tip) | Base::Crater(tangent, tip, ..) = self.base {
            bounded("angle", tangent.abs(), 0.0, 10.0, "between 0 and 1.47 rad")?;
            bounded("tip", tip, 1e-4 * self.radius, 1e3, "at least 0.0001 silo radii")?;
        }
        bounded("tilt", self.tilt[0].hypot(self.tilt[1]), 0.0, 10.0, "between 0 and 1.47 rad")?;
        bounded("centre", self.centre[0].hypot(self.centre[1]), 0.0, self.radius, "within the silo")?;
        self.ratholes.iter().try_for_each(|hole| hole.validate(self.radius))
    }

    /// Height and derivatives at a place.
    pub fn jet(&self, x: f64, y: f64) -> Jet {
        let base = self.base.jet(x - self.centre[0], y - self.centre[1], self.radius);
        let plane = [self.tilt[0] * x + self.tilt[1] * y, self.tilt[0], self.tilt[1]];
        let lumps = self.lumps.as_ref().map_or([0.0; 3], |lumps| lumps.jet(x, y));
        self.ratholes.iter().fold(add(add(base, plane), lumps), |sum, hole| add(sum, hole.jet(x, y)))
    }

    /// Bound of the second derivatives around a place, and the radius around it in which the bound holds.
    pub fn bend_around(&self, x: f64, y: f64) -> (f64, f64) {
        let smooth = self.base.bend(self.radius) + self.lumps.as_ref().map_or(0.0, Lumps::bend);
        self.ratholes.iter().fold((smooth, f64::INFINITY), |(bend, radius), hole| {
            let away = (x - hole.centre[0]).hypot(y - hole.centre[1]) - hole.reach();
            if away > 0.1 * hole.radius { (bend, radius.min(away)) } else { (bend + hole.bend(), radius) }
        })
    }

    /// Bound of the slopes.
    pub fn steepness(&self) -> f64 {
        let holes: f64 = self.ratholes.iter().map(Rathole::steepness).sum();
        let lumps = self.lumps.as_ref().map_or(0.0, Lumps::steepness);
        self.base.steepness() + self.tilt[0].hypot(self.tilt[1]) + lumps + holes
    }
}

impl Feed {
    /// Fills a silo with a shape so high that its highest point lies at `level` of the silo's height.
    pub fn fill(silo: &Silo, shape: Shape, level: f64) -> Result<Self> {
        bounded("level", level, 0.0, 1.0, "between 0 and 1, as a share of the silo's height")?;
        shape.validate()?;
        let offset = highest_offset(silo, &shape, level * silo.height());
        let steepness = shape.steepness();
        Ok(Self { level, shape, offset, silo: silo.clone(), steepness })
    }

    /// Height of the feed surface over the vertex, which may lie below the cone.
    pub fn height(&self, x: f64, y: f64) -> f64 {
        self.offset + self.shape.jet(x, y)[0]
    }

    /// Height of the feed surface over the vertex; NaN where the floor lies higher, and outside the silo.
    pub fn height_above_floor(&self, x: f64, y: f64) -> f64 {
        let r = x.hypot(y);
        let direction = if r > 0.0 { (x / r, y / r) } else { (1.0, 0.0) };
        let floor = if r <= self.silo.radius { self.silo.floor_height(r, direction) } else { f64::INFINITY };
        Some(self.height(x, y)).filter(|&height| height > floor).unwrap_or(f64::NAN)
    }

    /// How far the feed surface lies below a point.
    pub fn depth_below(&self, p: &Vec3) -> f64 {
        self.silo.apex() - self.height(p.x, p.y) - p.z
    }

    /// First hit of a ray between `start` and `end`.
    pub fn cast(&self, origin: &Vec3, ray: &Vec3, start: f64, end: f64) -> Option<Hit> {
        let t = first_crossing(|t| self.submersion(origin, ray, t), start, end)?;
        Some(Hit { t, normal: self.normal(&(origin + ray * t)), label: Label::Feed })
    }

    /// Parameter before which a ray inside the silo is above all feed; walls may bulge by `bulge`.
    pub fn lid(&self, origin: &Vec3, ray: &Vec3, bulge: f64) -> f64 {
        let lid = self.silo.apex() - self.level * self.silo.height() - 1e-6 - bulge * self.steepness;
        if ray.z > 0.0 { ((lid - origin.z) / ray.z).max(0.0) } else { 0.0 }
    }

    /// How deep the ray is below the surface at `t`.
    fn submersion(&self, origin: &Vec3, ray: &Vec3, t: f64) -> Probe {
        let p = origin + ray * t;
        let [height, along_x, along_y] = self.shape.jet(p.x, p.y);
        let speed = ray.x.hypot(ray.y);
        let (bend, radius) = self.shape.bend_around(p.x, p.y);
        Probe {
            value: p.z - self.silo.apex() + self.offset + height,
            slope: ray.z + along_x * ray.x + along_y * ray.y,
            bend: bend * speed * speed,
            reach: radius / speed, // infinite straight down
        }
    }

    /// Unit normal of the surface, upwards.
    fn normal(&self, p: &Vec3) -> Vec3 {
        let [_, along_x, along_y] = self.shape.jet(p.x, p.y);
        -Vec3::new(along_x, along_y, 1.0).normalize()
    }
}

/// The largest offset at which no feed inside the silo is higher than `top`.
///
/// A place holds feed where offset + shape is above the cone's wall there, so the offset is the minimum over the silo
/// of `max(top, wall) - shape`.
fn highest_offset(silo: &Silo, shape: &Shape, top: f64) -> f64 {
    const RINGS: usize = 96;
    const SPOKES: usize = 144;
    let room = |r: f64, angle: f64| {
        let (sin, cos) = angle.sin_cos();
        silo.floor_height(r, (cos, sin)).max(top) - shape.jet(r * cos, r * sin)[0]
    };
    let mut best = (room(0.0, 0.0), 0.0, 0.0);
    for ring in 1..=RINGS {
        for spoke in 0..SPOKES {
            let (r, angle) =
                (silo.radius * ring as f64 / RINGS as f64, std::f64::consts::TAU * spoke as f64 / SPOKES as f64);
            let here = room(r, angle);
            if here < best.0 {
                best = (here, r, angle);
            }
        }
    }
    polish(room, best, silo.radius)
}

/// Pattern search for the minimum of `f(r, angle)` near a start, down to 1e-12 of the radius.
fn polish(f: impl Fn(f64, f64) -> f64, start: (f64, f64, f64), radius: f64) -> f64 {
    let (mut least, mut r, mut angle) = start;
    let mut step = radius / 64.0;
    while step > 1e-10 * radius {
        let turn = step / r.max(step);
        let around = [(r + step, angle), (r - step, angle), (r, angle + turn), (r, angle - turn)];
        let moved = around.iter().map(|&(r, a)| (r.clamp(0.0, radius), a)).map(|(r, a)| (f(r, a), r, a));
        match moved.min_by(|a, b| a.0.total_cmp(&b.0)) {
            Some(better) if better.0 < least => (least, r, angle) = better,
            _ => step /= 2.0,
        }
    }
    least
}
