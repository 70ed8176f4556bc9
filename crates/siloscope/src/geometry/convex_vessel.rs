//! Ray intersection with a cylinder above a cone that may stand beside the cylinder's axis and lean.
//!
//! In the silo frame both parts are circles about a centre a(z): F = |(x, y) − a(z)| − R(z) − w = 0, with a local bulge
//! w of the wall. The cylinder has a = 0 and R(z) = R. The cone has a(z) = a₀ + g (z − z_b) and R(z) = b₀ − m z: an
//! offset a₀ at the height z_b, an obliquity g (horizontal metres per metre of height), a slope m and an intercept b₀.
//! From inside, a ray ends on the nearer of both.

use crate::SiloPose;
use crate::geometry::surface::Part;
use nalgebra::Matrix3;

/// A cone ρ = b₀ − m z about the line a(z) = a₀ + g (z − z_b).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LeaningCone {
    /// m, metres of radius lost per metre of height downwards.
    pub slope: f64,
    /// b₀, radius at the camera's height, metres.
    pub intercept: f64,
    /// a₀, centre at the height `reference`, metres.
    pub offset: [f64; 2],
    /// g, horizontal metres of the centre per metre of height.
    pub obliquity: [f64; 2],
    /// z_b, height at which `offset` is the centre, metres.
    pub reference: f64,
}

/// A camera's pose in a vessel; a part that is not there is `None`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ConvexVessel {
    /// Camera in the silo.
    pub pose: SiloPose,
    /// Radius of the cylinder, metres.
    pub radius: Option<f64>,
    /// The cone.
    pub cone: Option<LeaningCone>,
}

/// A vessel with its rotation and constant terms worked out.
#[derive(Debug, Clone)]
pub struct Raycaster {
    /// The vessel.
    pub vessel: ConvexVessel,
    rotation: Matrix3<f64>,
    by_rx: Matrix3<f64>,
    by_ry: Matrix3<f64>,
    /// The camera relative to the cone's centre line, at height 0.
    beside_cone: [f64; 2],
}

/// The implicit function's derivatives where a ray meets the wall.
#[derive(Debug, Clone, Copy)]
pub struct Incidence {
    /// Part of the wall.
    pub part: Part,
    /// Height z in the silo frame, metres.
    pub z: f64,
    /// Unit vector from the part's centre to the point: cos φ and sin φ of its azimuth.
    pub radial: [f64; 2],
    /// ∂F/∂z.
    pub rise: f64,
    /// ∇F·D, the rate of F along the ray per metre of depth.
    pub along: f64,
}

/// A ray's direction in the silo frame per metre of depth.
pub type Direction = [f64; 3];

impl Raycaster {
    /// Works out the constant terms of a vessel.
    pub fn new(vessel: ConvexVessel) -> Self {
        let SiloPose { r_x, r_y, t_x, t_y } = vessel.pose;
        let ((sx, cx), (sy, cy)) = (r_x.sin_cos(), r_y.sin_cos());
        let beside = |c: LeaningCone| {
            [t_x - c.offset[0] + c.obliquity[0] * c.reference, t_y - c.offset[1] + c.obliquity[1] * c.reference]
        };
        Self {
            vessel,
            rotation: vessel.pose.rotation(),
            by_rx: Matrix3::new(0.0, cx * sy, -sx * sy, 0.0, -sx, -cx, 0.0, cx * cy, -sx * cy),
            by_ry: Matrix3::new(-sy, sx * cy, cx * cy, 0.0, 0.0, 0.0, -cy, -sx * sy, -cx * sy),
            beside_cone: vessel.cone.map_or([f64::NAN; 2], beside),
        }
    }

    /// The ray `(x, y, 1)` of the camera frame in the silo frame.
    #[inline(always)]
    pub fn turn(&self, [x, y]: [f64; 2]) -> Direction {
        turned(&self.rotation, [x, y])
    }

    /// Derivatives of a ray's direction by r_x and r_y.
    #[inline(always)]
    pub fn turn_derivatives(&self, ray: [f64; 2]) -> [Direction; 2] {
        [turned(&self.by_rx, ray), turned(&self.by_ry, ray)]
    }

    /// Derivatives of a ray's direction by x and y.
    #[inline(always)]
    pub fn ray_derivatives(&self) -> [Direction; 2] {
        let r = &self.rotation;
        [[r[(0, 0)], r[(1, 0)], r[(2, 0)]], [r[(0, 1)], r[(1, 1)], r[(2, 1)]]]
    }

    /// A direction of the camera frame in the silo frame.
    #[inline(always)]
    pub fn rotate(&self, v: &crate::Vec3) -> crate::Vec3 {
        self.rotation * v
    }

    /// True depth at which a direction meets the cylinder with a bulge; infinite where it does not.
    #[inline(always)]
    pub fn cylinder_depth(&self, d: &Direction, bulge: f64) -> f64 {
        let Some(radius) = self.vessel.radius else { return f64::INFINITY };
        let SiloPose { t_x, t_y, .. } = self.vessel.pose;
        let radius = radius + bulge;
        let a = d[0] * d[0] + d[1] * d[1];
        let b = t_x * d[0] + t_y * d[1];
        far_root(a, b, t_x * t_x + t_y * t_y - radius * radius)
    }

    /// True depth at which a direction meets the cone with a bulge; infinite where it does not.
    #[inline(always)]
    pub fn cone_depth(&self, d: &Direction, bulge: f64) -> f64 {
        let Some(cone) = self.vessel.cone else { return f64::INFINITY };
        let [px, py] = self.beside_cone;
        let (vx, vy) = (d[0] - cone.obliquity[0] * d[2], d[1] - cone.obliquity[1] * d[2]);
        let (m, b0) = (cone.slope * d[2], cone.intercept + bulge);
        let a = vx * vx + vy * vy - m * m;
        let b = px * vx + py * vy + b0 * m;
        far_root(a, b, px * px + py * py - b0 * b0)
    }

    /// True depth on a given part.
    #[inline(always)]
    pub fn part_depth(&self, d: &Direction, part: Part, bulge: f64) -> f64 {
        match part {
            Part::Cylinder => self.cylinder_depth(d, bulge),
            Part::Cone => self.cone_depth(d, bulge),
        }
    }

    /// True depth at which a direction ends, and on which part; `bulges` are those of cylinder and cone.
    #[inline(always)]
    pub fn depth(&self, d: &Direction, bulges: [f64; 2]) -> (f64, Part) {
        let (cylinder, cone) = (self.cylinder_depth(d, bulges[0]), self.cone_depth(d, bulges[1]));
        if cone < cylinder { (cone, Part::Cone) } else { (cylinder, Part::Cylinder) }
    }

    /// The implicit function's derivatives at a depth along a direction.
    #[inline(always)]
    pub fn incidence(&self, d: &Direction, depth: f64, part: Part) -> Incidence {
        let SiloPose { t_x, t_y, .. } = self.vessel.pose;
        let z = depth * d[2];
        let (mut x, mut y, mut slope, mut lean) = (t_x + depth * d[0], t_y + depth * d[1], 0.0, [0.0; 2]);
        if let (Part::Cone, Some(cone)) = (part, self.vessel.cone) {
            (slope, lean) = (cone.slope, cone.obliquity);
            x -= cone.offset[0] + lean[0] * (z - cone.reference);
            y -= cone.offset[1] + lean[1] * (z - cone.reference);
        }
        let inverse = 1.0 / (x * x + y * y).sqrt().max(1e-12);
        let radial = [x * inverse, y * inverse];
        let rise = slope - radial[0] * lean[0] - radial[1] * lean[1];
        Incidence { part, z, radial, rise, along: radial[0] * d[0] + radial[1] * d[1] + rise * d[2] }
    }
}

impl Incidence {
    /// Directional derivative of F: its gradient times a direction.
    #[inline(always)]
    pub fn dot(&self, v: &Direction) -> f64 {
        self.radial[0] * v[0] + self.radial[1] * v[1] + self.rise * v[2]
    }

    /// Length of the gradient.
    #[inline(always)]
    pub fn gradient_norm(&self) -> f64 {
        (1.0 + self.rise * self.rise).sqrt()
    }
}

#[inline(always)]
fn turned(m: &Matrix3<f64>, [x, y]: [f64; 2]) -> Direction {
    [0, 1, 2].map(|k| m[(k, 0)] * x + m[(k, 1)] * y + m[(k, 2)])
}

/// Where a ray from inside (c < 0) leaves the quadric a d² + 2 b d + c = 0: right for either sign of a.
#[inline(always)]
fn far_root(a: f64, b: f64, c: f64) -> f64 {
    let square = b * b - a * c;
    let divisor = b + square.max(0.0).sqrt();
    if c < 0.0 && square > 0.0 && divisor > 1e-9 { -c / divisor } else { f64::INFINITY }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn vessel(r_x: f64, r_y: f64, offset: [f64; 2], obliquity: [f64; 2]) -> ConvexVessel {
        let cone = LeaningCone { slope: 0.8, intercept: 4.0, offset, obliquity, reference: 3.4 };
        let pose = SiloPose { r_x, r_y, t_x: 0.3, t_y: -0.2 };
        ConvexVessel { pose, radius: Some(1.25), cone: Some(cone) }
    }

    proptest! {
        #[test]
        fn rays_end_on_the_surface(
            r_x in -0.4..0.4f64, r_y in -0.4..0.4f64, x in -0.5..0.5f64, y in -0.4..0.4f64,
            a in -0.3..0.3f64, b in -0.3..0.3f64, g in -0.3..0.3f64, h in -0.3..0.3f64, bulge in -0.02..0.02f64,
        ) {
            let caster = Raycaster::new(vessel(r_x, r_y, [a, b], [g, h]));
            let turned = caster.turn([x, y]);
            for part in [Part::Cylinder, Part::Cone] {
                let d = caster.part_depth(&turned, part, bulge);
                prop_assume!(d.is_finite());
                let p = [0.3 + d * turned[0], -0.2 + d * turned[1], d * turned[2]];
                let (centre, radius) = match part {
                    Part::Cylinder => ([0.0; 2], 1.25),
                    Part::Cone => ([a + g * (p[2] - 3.4), b + h * (p[2] - 3.4)], 4.0 - 0.8 * p[2]),
                };
                let off = (p[0] - centre[0]).hypot(p[1] - centre[1]) - radius - bulge;
                prop_assert!(d > 0.0 && off.abs() < 1e-9 * (1.0 + d), "{part:?} {d} {off}");
            }
        }

        #[test]
        fn the_rate_along_a_ray_is_that_of_the_implicit_function(
            x in -0.5..0.5f64, y in -0.4..0.4f64, a in -0.3..0.3f64, g in -0.3..0.3f64,
        ) {
            let caster = Raycaster::new(vessel(0.1, -0.2, [a, 0.1], [g, -0.1]));
            let turned = caster.turn([x, y]);
            let value = |d: f64| {
                let (z, px, py) = (d * turned[2], 0.3 + d * turned[0], -0.2 + d * turned[1]);
                (px - a - g * (z - 3.4)).hypot(py - 0.1 + 0.1 * (z - 3.4)) - 4.0 + 0.8 * z
            };
            let d = caster.cone_depth(&turned, 0.0);
            prop_assume!(d.is_finite());
            let numeric = (value(d + 1e-6) - value(d - 1e-6)) / 2e-6;
            prop_assert!((caster.incidence(&turned, d, Part::Cone).along - numeric).abs() < 1e-6);
        }
    }
}
