//! Things in the silo: ladder, cables, sweep auger. All are made of round bars.

use crate::hit::{Hit, Label};
use crate::limits::bounded;
use siloscope::{Result, Vec3};

/// A round bar with round ends.
#[derive(Debug, Clone, PartialEq)]
pub struct Bar {
    /// One end of its middle line.
    pub from: Vec3,
    /// The other end.
    pub to: Vec3,
    /// Its radius.
    pub radius: f64,
}

/// Bars that lie together, and one thick bar around them all that a ray is tested against first.
#[derive(Debug, Clone, PartialEq)]
pub struct Bundle {
    hull: Bar,
    bars: Vec<Bar>,
}

impl Bar {
    /// Checks that its numbers are finite and its radius is a radius.
    pub fn validate(&self) -> Result<()> {
        bounded("bar radius", self.radius, 1e-4, 1e2, "between 0.0001 and 100 m")?;
        self.from.iter().chain(self.to.iter()).try_for_each(|&x| bounded("bar end", x, -1e4, 1e4, "at finite places"))
    }

    /// Smallest positive parameter at which a ray from outside enters the bar, with the normal there.
    fn enter(&self, origin: &Vec3, ray: &Vec3) -> Option<(f64, Vec3)> {
        let (axis, from) = (self.to - self.from, origin - self.from);
        let (aa, ad, ao) = (axis.norm_squared(), axis.dot(ray), axis.dot(&from));
        let side = Quadratic {
            a: aa * ray.norm_squared() - ad * ad,
            b: aa * ray.dot(&from) - ad * ao,
            c: aa * from.norm_squared() - ao * ao - self.radius * self.radius * aa,
        };
        let along = |t: f64| (ao + t * ad) / aa;
        let on_side = side.entry().filter(|&t| aa > 0.0 && (0.0..=1.0).contains(&along(t)));
        let ends = [&self.from, &self.to].map(|end| enter_ball(origin, ray, end, self.radius));
        let t = ends.into_iter().chain([on_side]).flatten().filter(|&t| t > 0.0).reduce(f64::min)?;
        let share = if aa > 0.0 { along(t).clamp(0.0, 1.0) } else { 0.0 };
        Some((t, (origin + ray * t - self.from - axis * share) / self.radius))
    }

    /// Squared distance between a ray's line and the middle of the bar's ball hull is cheap, so it comes first.
    fn may_hit(&self, origin: &Vec3, ray: &Vec3) -> bool {
        let middle = (self.from + self.to) * 0.5 - origin;
        let reach = (self.to - self.from).norm() * 0.5 + self.radius;
        middle.cross(ray).norm_squared() <= reach * reach * ray.norm_squared()
    }
}

struct Quadratic {
    a: f64,
    b: f64,
    c: f64,
}

impl Quadratic {
    /// The smaller root of `a t² + 2 b t + c`, where the ray enters.
    fn entry(&self) -> Option<f64> {
        let discriminant = self.b * self.b - self.a * self.c;
        (self.a > 0.0 && discriminant >= 0.0).then(|| {
            let root = discriminant.sqrt();
            if self.b < 0.0 { self.c / (root - self.b) } else { -(self.b + root) / self.a }
        })
    }
}

fn enter_ball(origin: &Vec3, ray: &Vec3, centre: &Vec3, radius: f64) -> Option<f64> {
    let from = origin - centre;
    Quadratic { a: ray.norm_squared(), b: ray.dot(&from), c: from.norm_squared() - radius * radius }.entry()
}

impl Bundle {
    /// Bundles bars.
    pub fn new(bars: Vec<Bar>) -> Result<Self> {
        bars.iter().try_for_each(Bar::validate)?;
        let ends = || bars.iter().flat_map(|bar| [bar.from, bar.to]);
        let low = ends().fold(Vec3::repeat(f64::INFINITY), |low, p| low.inf(&p));
        let high = ends().fold(Vec3::repeat(f64::NEG_INFINITY), |high, p| high.sup(&p));
        let thickest = bars.iter().map(|bar| bar.radius).fold(0.0, f64::max);
        let middle = (low + high) * 0.5;
        let half = (high - low) * 0.5;
        let along = Vec3::z() * half.z;
        let hull = Bar { from: middle - along, to: middle + along, radius: half.xy().norm() + thickest };
        Ok(Self { hull, bars })
    }

    /// First hit of a ray.
    pub fn cast(&self, origin: &Vec3, ray: &Vec3) -> Option<Hit> {
        let inside = self.hull.contains(origin);
        if !inside && (!self.hull.may_hit(origin, ray) || self.hull.enter(origin, ray).is_none()) {
            return None;
        }
        let hits = self.bars.iter().filter(|bar| bar.may_hit(origin, ray)).filter_map(|bar| bar.enter(origin, ray));
        let (t, normal) = hits.min_by(|a, b| a.0.total_cmp(&b.0))?;
        Some(Hit { t, normal, label: Label::Other })
    }
}

impl Bar {
    /// Whether a point is inside the bar.
    pub fn contains(&self, p: &Vec3) -> bool {
        let (axis, from) = (self.to - self.from, p - self.from);
        let share = if axis.norm_squared() > 0.0 { axis.dot(&from) / axis.norm_squared() } else { 0.0 };
        (from - axis * share.clamp(0.0, 1.0)).norm() < self.radius
    }
}
