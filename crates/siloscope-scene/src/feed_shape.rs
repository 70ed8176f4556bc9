//! The feed's shape: a base shape, a tilt, lumps and ratholes, with their derivatives.

use crate::limits::bounded;
use crate::random::Stream;
use crate::spline::{spline, spline_slope};
use siloscope::Result;

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
