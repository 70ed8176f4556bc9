//! What closes the cylinder below: a cone, an oblique one, two stages, a pyramid, a flat floor.

use crate::hit::{Hit, Label};
use crate::limits::bounded;
use crate::quadrics::{cone_exit, cylinder_exit, radial};
use siloscope::{Result, Vec3};
use std::f64::consts::{FRAC_PI_2, PI};

/// The bottom's kind; the silo has its height and, for the oblique one, the place of its vertex.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Bottom {
    /// A cone about the axis.
    #[default]
    Cone,
    /// A cone from the cylinder's rim to a vertex above the outlet's offset.
    Oblique,
    /// A cone to a waist, and another from there to the vertex.
    TwoStage {
        /// Radius of the waist.
        waist: f64,
        /// How far it lies below the rim.
        depth: f64,
    },
    /// A pyramid of four sides that touch the cylinder at its rim, the first falling away from an azimuth.
    Pyramid {
        /// Azimuth, rad.
        azimuth: f64,
    },
    /// A level floor.
    Flat,
}

/// Where a bottom hangs: the cylinder's radius and the z of its lower edge, the height down to the vertex, and how far
/// that is off the axis if the cone is oblique.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place {
    /// Radius of the cylinder.
    pub radius: f64,
    /// z of its lower edge.
    pub rim: f64,
    /// From there to the vertex.
    pub height: f64,
    /// Offset of an oblique cone's vertex.
    pub vertex: [f64; 2],
}

impl Place {
    fn apex(&self) -> f64 {
        self.rim + self.height
    }

    fn slope(&self) -> f64 {
        self.radius / self.height
    }

    fn cone_normal(&self, p: &Vec3) -> Vec3 {
        let out = radial(p);
        -Vec3::new(out.x, out.y, self.slope()).normalize()
    }
}

impl Bottom {
    /// Checks it against the silo's lengths.
    pub fn validate(&self, at: &Place) -> Result<()> {
        match *self {
            Bottom::Flat => bounded("cone_height", at.height, 0.0, 0.0, "0 above a flat floor"),
            Bottom::TwoStage { waist, depth } => {
                bounded("waist_radius", waist, 0.05 * at.radius, 0.95 * at.radius, "0.05 to 0.95 silo radii")?;
                let share = depth / at.height;
                bounded("waist_depth", share, 0.02, 0.98, "between 0.02 and 0.98 of the cone's height")
            }
            Bottom::Pyramid { azimuth } => bounded("bottom_azimuth", azimuth, -1e3, 1e3, "a finite angle"),
            Bottom::Cone | Bottom::Oblique => Ok(()),
        }
    }

    /// Height over the lowest point of the bottom at distance `r` from the axis in the direction (cos, sin).
    pub fn height(&self, at: &Place, r: f64, (cos, sin): (f64, f64)) -> f64 {
        match *self {
            Bottom::Cone => at.height * r / at.radius,
            Bottom::Flat => 0.0,
            Bottom::Pyramid { azimuth } => {
                let (s, c) = azimuth.sin_cos();
                let (along, across) = (r * (c * cos + s * sin), r * (c * sin - s * cos));
                at.height * along.abs().max(across.abs()) / at.radius
            }
            Bottom::TwoStage { waist, depth } if r > waist => at.height - depth * (at.radius - r) / (at.radius - waist),
            Bottom::TwoStage { waist, depth } => (at.height - depth) * r / waist,
            Bottom::Oblique => at.height * (1.0 - oblique_share(at, r * cos, r * sin)),
        }
    }

    /// Volume between the rim and the vertex, without the outlet pipe.
    pub fn volume(&self, at: &Place) -> f64 {
        let (r, h) = (at.radius, at.height);
        match *self {
            Bottom::Flat => 0.0,
            Bottom::Cone | Bottom::Oblique => PI * r * r * h / 3.0,
            Bottom::TwoStage { waist, depth } => {
                PI / 3.0 * (depth * (r * r + r * waist + waist * waist) + (h - depth) * waist * waist)
            }
            // The mean of max(|cos|, |sin|) around the circle is 2·√2/π, that of the height 2/3 of it.
            Bottom::Pyramid { .. } => PI * r * r * h * (1.0 - 2.0 / 3.0 * 2.0 * std::f64::consts::SQRT_2 / PI),
        }
    }

    /// Where a ray that goes down from inside the silo meets the bottom, which it does.
    pub fn cast(&self, at: &Place, origin: &Vec3, ray: &Vec3) -> Option<Hit> {
        match *self {
            Bottom::Cone => {
                let t = cone_exit(origin, ray, at.slope(), at.apex())?;
                Some(Hit { t, normal: at.cone_normal(&(origin + ray * t)), label: Label::Cone })
            }
            Bottom::Oblique => {
                let (from, along) = (sheared_point(at, origin), sheared_ray(at, ray));
                let t = cone_exit(&from, &along, at.slope(), at.apex())?;
                Some(unsheared(at, Hit { t, normal: at.cone_normal(&(from + along * t)), label: Label::Cone }))
            }
            Bottom::TwoStage { waist, depth } => two_stages(at, waist, depth, origin, ray),
            Bottom::Pyramid { azimuth } => pyramid(at, azimuth, origin, ray),
            Bottom::Flat => Some(level(at.rim, origin, ray)),
        }
    }
}

/// A hit on a level plane.
pub(crate) fn level(z: f64, origin: &Vec3, ray: &Vec3) -> Hit {
    Hit { t: (z - origin.z) / ray.z, normal: -Vec3::z(), label: Label::Cone }
}

/// Share of the way from the rim to the vertex at which an oblique cone passes a place (x, y).
fn oblique_share(at: &Place, x: f64, y: f64) -> f64 {
    let ([ex, ey], r2) = (at.vertex, at.radius * at.radius);
    let a = ex * ex + ey * ey - r2;
    let b = r2 - x * ex - y * ey;
    let c = x * x + y * y - r2;
    -c / (b + (b * b - a * c).max(0.0).sqrt())
}

/// The shear that makes an oblique cone a right one: it leaves the rim where it is.
pub(crate) fn sheared_point(at: &Place, p: &Vec3) -> Vec3 {
    let share = (p.z - at.rim) / at.height;
    Vec3::new(p.x - share * at.vertex[0], p.y - share * at.vertex[1], p.z)
}

/// The same of a direction.
pub(crate) fn sheared_ray(at: &Place, ray: &Vec3) -> Vec3 {
    let share = ray.z / at.height;
    Vec3::new(ray.x - share * at.vertex[0], ray.y - share * at.vertex[1], ray.z)
}

/// A hit on the right cone as one on the oblique cone: its normal is the shear's transpose of the other's.
pub(crate) fn unsheared(at: &Place, hit: Hit) -> Hit {
    let n = hit.normal;
    let fall = (n.x * at.vertex[0] + n.y * at.vertex[1]) / at.height;
    Hit { normal: Vec3::new(n.x, n.y, n.z - fall).normalize(), ..hit }
}

/// A cone of given slope with the ray's start moved to where the cone begins.
fn stage(origin: &Vec3, ray: &Vec3, from: f64, slope: f64, apex: f64) -> Option<Hit> {
    let start = ((from - origin.z) / ray.z).max(0.0);
    let t = start + cone_exit(&(origin + ray * start), ray, slope, apex)?;
    let out = radial(&(origin + ray * t));
    Some(Hit { t, normal: -Vec3::new(out.x, out.y, slope).normalize(), label: Label::Cone })
}

fn two_stages(at: &Place, waist: f64, depth: f64, origin: &Vec3, ray: &Vec3) -> Option<Hit> {
    let (rim, change) = (at.rim, at.rim + depth);
    let slope = (at.radius - waist) / depth;
    let upper = stage(origin, ray, rim, slope, rim + at.radius / slope);
    let lower = || stage(origin, ray, change, waist / (at.height - depth), at.apex());
    upper.filter(|hit| origin.z + hit.t * ray.z < change).or_else(lower)
}

/// The first of the four sides, or the cylinder where it stands in the pyramid.
fn pyramid(at: &Place, azimuth: f64, origin: &Vec3, ray: &Vec3) -> Option<Hit> {
    let slope = at.slope();
    let side = |i: u32| {
        let (sin, cos) = (azimuth + f64::from(i) * FRAC_PI_2).sin_cos();
        let out = Vec3::new(cos, sin, slope);
        let approach = out.dot(ray);
        let t = (at.radius + slope * at.rim - out.dot(origin)) / approach;
        (approach > 0.0).then(|| Hit { t, normal: -out.normalize(), label: Label::Cone })
    };
    let wall = cylinder_exit(origin, ray, at.radius).map(|t| {
        let normal = -radial(&(origin + ray * t));
        Hit { t, normal, label: Label::Cylinder }
    });
    (0..4).filter_map(side).chain(wall).min_by(|a, b| a.t.total_cmp(&b.t))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hung(bottom: Bottom, height: f64) -> (Bottom, Place) {
        (bottom, Place { radius: 1.3, rim: 1.8, height, vertex: [0.5, -0.3] })
    }

    fn all() -> [(Bottom, Place); 6] {
        [
            hung(Bottom::Cone, 1.4),
            hung(Bottom::Oblique, 1.4),
            hung(Bottom::TwoStage { waist: 0.6, depth: 0.5 }, 1.4),
            hung(Bottom::TwoStage { waist: 0.6, depth: 1.1 }, 1.4),
            hung(Bottom::Pyramid { azimuth: 0.4 }, 1.4),
            hung(Bottom::Flat, 0.0),
        ]
    }

    #[test]
    fn rays_end_on_the_height_that_the_bottom_has_there() {
        for (bottom, at) in all() {
            bottom.validate(&at).unwrap();
            for i in 0..400 {
                let turn = f64::from(i) * 0.7;
                let ray = Vec3::new(0.4 * turn.cos() * f64::from(i % 7) / 7.0, 0.4 * turn.sin(), 1.0);
                let origin = Vec3::new(0.5, -0.4, 0.0);
                let Some(hit) = bottom.cast(&at, &origin, &ray) else { panic!("{bottom:?} has a hole") };
                let p = origin + ray * hit.t;
                let r = p.xy().norm();
                if hit.label == Label::Cone && p.z > at.rim {
                    let height = bottom.height(&at, r, (p.x / r, p.y / r));
                    assert!((at.apex() - p.z - height).abs() < 1e-9, "{bottom:?} at {p:?}: {height}");
                }
                assert!(hit.normal.dot(&ray) < 0.0 && (hit.normal.norm() - 1.0).abs() < 1e-12);
                let side = hit.normal.cross(&Vec3::new(0.3, 0.5, 0.8)).normalize() * 1e-4;
                let beside = bottom.cast(&at, &(p + hit.normal * 0.01 + side), &(hit.normal * -1.0));
                let even = beside.filter(|beside| hit.normal.z < -1e-3 && (beside.normal - hit.normal).norm() < 0.01);
                assert!(even.is_none_or(|beside| (beside.t - 0.01).abs() < 1e-7), "{bottom:?}: no tangent");
            }
        }
    }

    #[test]
    fn volumes_are_the_integral_of_the_heights() {
        for (bottom, at) in all() {
            let n = 400;
            let cell = |i: i32, j: i32| {
                let r = at.radius * (f64::from(i) + 0.5) / f64::from(n);
                let angle = std::f64::consts::TAU * (f64::from(j) + 0.5) / f64::from(n);
                (at.height - bottom.height(&at, r, (angle.cos(), angle.sin()))) * r
            };
            let sum: f64 = (0..n).flat_map(|i| (0..n).map(move |j| (i, j))).map(|(i, j)| cell(i, j)).sum();
            let volume = sum * at.radius / f64::from(n) * std::f64::consts::TAU / f64::from(n);
            assert!((volume - bottom.volume(&at)).abs() < 2e-4, "{bottom:?}: {volume}");
        }
    }
}
