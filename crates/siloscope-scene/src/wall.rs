//! Walls that are not perfect: uneven and oval, found along the ray by safe steps.

use crate::bottom::{Bottom, level, sheared_point, sheared_ray, unsheared};
use crate::hit::{Hit, Label};
use crate::jet::Limits;
use crate::limits::bounded;
use crate::relief::Relief;
use crate::root::{Probe, first_crossing};
use crate::silo::Silo;
use siloscope::{Result, Vec3};

/// Feed on the wall is labelled as feed from this thickness on, metres.
const VISIBLE_FILM: f64 = 2e-3;

/// A silo whose wall stands at `r = p(z)·(1 + ovality·cos 2(azimuth - axis)) + relief·p(z)/R`, where p is the perfect
/// radius at z: R in the cylinder, falling to 0 in the cone.
#[derive(Debug, Clone)]
pub struct Wall {
    /// The perfect silo.
    pub silo: Silo,
    /// Unevenness.
    pub relief: Relief,
    /// Share of the radius by which the wall deviates from round, outwards and inwards.
    pub ovality: f64,
    /// Azimuth of the long diameter.
    pub ovality_azimuth: f64,
    limits: [Limits; 2],
}

/// The part of the wall that a ray is at.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Zone {
    Cylinder,
    Cone,
}

/// The wall's radius at a place, and its derivatives by azimuth and z.
struct Reach {
    radius: f64,
    by_azimuth: f64,
    by_z: f64,
}

impl Wall {
    /// Checks and builds the wall.
    pub fn new(silo: &Silo, relief: Relief, ovality: f64, ovality_azimuth: f64) -> Result<Self> {
        relief.validate()?;
        bounded("ovality", ovality, 0.0, 0.1, "between 0 and 0.1")?;
        bounded("ovality_azimuth", ovality_azimuth, -1e3, 1e3, "a finite angle")?;
        let limits = [relief.limits(true), relief.limits(false)];
        Ok(Self { silo: silo.clone(), relief, ovality, ovality_azimuth, limits })
    }

    fn limits(&self, zone: Zone) -> &Limits {
        &self.limits[zone as usize]
    }

    /// Share of the perfect radius within which there is surely air.
    fn free_share(&self, zone: Zone) -> f64 {
        1.0 - self.ovality - self.limits(zone).inwards / self.silo.radius
    }

    /// Radius around the axis within which a camera is clear of the wall.
    pub fn clear_radius(&self) -> f64 {
        self.silo.radius * self.free_share(Zone::Cylinder).min(self.free_share(Zone::Cone))
    }

    /// How far the wall reaches beyond the perfect one.
    pub fn bulge(&self) -> f64 {
        self.ovality * self.silo.radius + self.limits[0].outwards.max(self.limits[1].outwards)
    }

    /// First hit on cylinder or cone for a ray that starts in the silo's air.
    pub fn cast(&self, origin: &Vec3, ray: &Vec3) -> Option<Hit> {
        let at_height = |z: f64| (z - origin.z) / ray.z;
        let (bottom, apex) = (self.silo.bottom(), self.silo.apex());
        if ray.z <= 0.0 {
            let end = if ray.z < 0.0 { at_height(self.silo.top) } else { f64::INFINITY };
            return self.cast_zone(origin, ray, Zone::Cylinder, 0.0, end);
        }
        let change = at_height(bottom).max(0.0);
        let at = self.silo.place();
        let vertex = || level(apex, origin, ray);
        let cone = |o: &Vec3, d: &Vec3| self.cast_zone(o, d, Zone::Cone, change, at_height(apex));
        let cylinder = self.cast_zone(origin, ray, Zone::Cylinder, 0.0, change);
        cylinder.or_else(|| match self.silo.floor {
            Bottom::Cone => cone(origin, ray).or_else(|| Some(vertex())),
            Bottom::Oblique => {
                let hit = cone(&sheared_point(&at, origin), &sheared_ray(&at, ray));
                Some(hit.map_or_else(vertex, |hit| unsheared(&at, hit)))
            }
            Bottom::Pyramid { .. } => {
                let below = self.cast_zone(origin, ray, Zone::Cylinder, change, at_height(apex));
                let side = self.silo.floor.cast(&at, origin, ray).filter(|hit| hit.label == Label::Cone);
                below.into_iter().chain(side).min_by(|a, b| a.t.total_cmp(&b.t)).or_else(|| Some(vertex()))
            }
            // A wall that bulges out over the rim leaves a ledge there, outside of which no bottom goes on upwards.
            floor => {
                let below = floor.cast(&at, origin, ray).filter(|hit| hit.t >= change);
                below.or_else(|| Some(level(bottom, origin, ray)))
            }
        })
    }

    fn cast_zone(&self, origin: &Vec3, ray: &Vec3, zone: Zone, start: f64, end: f64) -> Option<Hit> {
        let mut spans = self.near_wall(origin, ray, zone).into_iter();
        let t = spans.find_map(|(from, to)| {
            first_crossing(|t| self.probe(origin, ray, zone, t), from.max(start), to.min(end))
        })?;
        let p = origin + ray * t;
        Some(Hit { t, normal: self.normal(&p, zone), label: self.label(&p, zone) })
    }

    /// The spans of the ray outside the surely free core, where `a t² + 2 b t + c >= 0`.
    fn near_wall(&self, o: &Vec3, d: &Vec3, zone: Zone) -> [(f64, f64); 2] {
        let core = self.free_share(zone) * self.silo.radius;
        let (mut a, mut b, mut c) = (d.x * d.x + d.y * d.y, o.x * d.x + o.y * d.y, o.x * o.x + o.y * o.y);
        if zone == Zone::Cylinder {
            c -= core * core;
        } else {
            let (s2, rise) = ((core / self.silo.cone_height).powi(2), self.silo.apex() - o.z);
            (a, b, c) = (a - s2 * d.z * d.z, b + s2 * rise * d.z, c - s2 * rise * rise);
        }
        not_negative(a, b, c)
    }

    /// How far the point at `t` is beyond the wall.
    fn probe(&self, origin: &Vec3, ray: &Vec3, zone: Zone, t: f64) -> Probe {
        let p = origin + ray * t;
        let r = p.xy().norm().max(1e-300);
        let reach = self.reach(&p, zone);
        let turning = (p.x * ray.y - p.y * ray.x) / (r * r);
        let slope = (p.x * ray.x + p.y * ray.y) / r - reach.by_azimuth * turning - reach.by_z * ray.z;
        let (bend, span) = self.bend(&p, ray, zone);
        Probe { value: r - reach.radius, slope, bend, reach: span }
    }

    /// Bound of the second derivative along the ray, and how far it holds: while p(z) falls by no more than a half.
    ///
    /// With ω = |d_xy|/r the azimuth's derivatives are at most ω and ω².
    fn bend(&self, p: &Vec3, ray: &Vec3, zone: Zone) -> (f64, f64) {
        let (silo, limits, o) = (&self.silo, self.limits(zone), self.ovality);
        let perfect = self.perfect(p.z, zone);
        let (least, span, fall) = match zone {
            Zone::Cylinder => (perfect, f64::INFINITY, 0.0),
            Zone::Cone => {
                let fall = silo.slope() * ray.z.abs();
                (0.5 * perfect, 0.5 * perfect / fall.max(1e-300), fall)
            }
        };
        let across = ray.x * ray.x + ray.y * ray.y;
        let omega = across.sqrt() / (least * self.free_share(zone)).max(1e-300);
        let arc = silo.radius * omega;
        let oval = 4.0 * fall * o * omega + 6.0 * perfect * o * omega * omega;
        let speed2 = arc * arc + ray.z * ray.z;
        let relief = 2.0 * fall / silo.radius * limits.slope * speed2.sqrt()
            + perfect / silo.radius * (limits.bend * speed2 + limits.slope * arc * omega);
        (across.sqrt() * omega + oval + relief, span.max(1e-12))
    }

    fn perfect(&self, z: f64, zone: Zone) -> f64 {
        match zone {
            Zone::Cylinder => self.silo.radius,
            Zone::Cone => (self.silo.slope() * (self.silo.apex() - z)).max(0.0),
        }
    }

    fn reach(&self, p: &Vec3, zone: Zone) -> Reach {
        let azimuth = p.y.atan2(p.x);
        let perfect = self.perfect(p.z, zone);
        let fall = if zone == Zone::Cone { -self.silo.slope() } else { 0.0 };
        let (sin, cos) = (2.0 * (azimuth - self.ovality_azimuth)).sin_cos();
        let [height, along, down] = self.relief.jet(azimuth, p.z, zone == Zone::Cylinder);
        let scale = perfect / self.silo.radius;
        Reach {
            radius: perfect * (1.0 + self.ovality * cos) + scale * height,
            by_azimuth: -2.0 * perfect * self.ovality * sin + scale * along * self.silo.radius,
            by_z: fall * (1.0 + self.ovality * cos + height / self.silo.radius) + scale * down,
        }
    }

    /// Unit normal towards the air.
    fn normal(&self, p: &Vec3, zone: Zone) -> Vec3 {
        let out = crate::quadrics::radial(p);
        let around = Vec3::new(-out.y, out.x, 0.0);
        let reach = self.reach(p, zone);
        let r = p.xy().norm().max(1e-300);
        -(out - around * (reach.by_azimuth / r) - Vec3::z() * reach.by_z).normalize()
    }

    fn label(&self, p: &Vec3, zone: Zone) -> Label {
        let film = -self.relief.film(p.y.atan2(p.x), p.z)[0];
        match zone {
            _ if film > VISIBLE_FILM => Label::Feed,
            Zone::Cylinder => Label::Cylinder,
            Zone::Cone => Label::Cone,
        }
    }
}

/// Where `a t² + 2 b t + c >= 0`, as two spans of which some may be empty.
fn not_negative(a: f64, b: f64, c: f64) -> [(f64, f64); 2] {
    const EMPTY: (f64, f64) = (f64::INFINITY, f64::NEG_INFINITY);
    const ALL: (f64, f64) = (f64::NEG_INFINITY, f64::INFINITY);
    let discriminant = b * b - a * c;
    if discriminant <= 0.0 {
        return [if c >= 0.0 { ALL } else { EMPTY }, EMPTY];
    }
    let q = -(b + discriminant.sqrt().copysign(b)); // both roots without cancellation
    let (one, two) = (q / a, c / q);
    let (low, high) = (one.min(two), one.max(two));
    if a > 0.0 {
        [(f64::NEG_INFINITY, low), (high, f64::INFINITY)]
    } else if a < 0.0 {
        [(low, high), EMPTY]
    } else {
        [if b > 0.0 { (two, f64::INFINITY) } else { (f64::NEG_INFINITY, two) }, EMPTY]
    }
}
