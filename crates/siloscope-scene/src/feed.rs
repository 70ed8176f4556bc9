//! The feed: a height field over the cone's vertex.

use crate::feed_shape::Shape;
use crate::hit::{Hit, Label};
use crate::limits::bounded;
use crate::root::{Probe, first_crossing};
use crate::silo::Silo;
use siloscope::{Result, Vec3};

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
