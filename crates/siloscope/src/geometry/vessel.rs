//! The silo's wall as a surface: a cylinder above a cone, its implicit functions, derivatives and ray intersections.
//!
//! In the silo frame, with ρ = √(x² + y²): the cylinder is ρ − R = 0 for z below `cylinder_bottom` in number, the cone
//! is ρ − m·(z_a − z) = 0 from there to its apex z_a. Either may be missing. A real silo is a little oval: both radii
//! then change with the azimuth φ by the factor 1 + c·cos 2φ + s·sin 2φ. The gradient of both has a radial part of 1, so
//! one residual formula serves both: the distance along a ray with direction q is F / (∇F·q).

use crate::{SiloPose, Vec3};
use nalgebra::{Matrix3, SMatrix, SVector};

/// Number of parameters of the fit.
pub const PARAMETERS: usize = 12;

/// Index of the first of the ovality's two parameters.
pub const OVALITY: usize = 10;

/// Order of the parameters: r_x, r_y, t_x, t_y, radius, cone slope, cone intercept, the depth bias (offset, scale,
/// quadratic), and the ovality (cosine and sine part).
///
/// The cone's intercept is its radius m·z_a at the camera's height. The cone's radius m·z_a − m·z is linear in it and in
/// the slope. In slope and apex it is not: where little of the cone is seen, a frame leaves a long valley open between
/// them, and that would be bent.
pub type Parameters = SVector<f64, PARAMETERS>;

/// Information or covariance over `Parameters`.
pub type Information = SMatrix<f64, PARAMETERS, PARAMETERS>;

/// Which part of the wall a point belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// The cylinder.
    Cylinder,
    /// The cone.
    Cone,
}

/// Cylinder and cone about one axis; a part that is not there is `None`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SiloSurface {
    /// Camera in the silo.
    pub pose: SiloPose,
    /// Radius R of the cylinder, metres.
    pub radius: Option<f64>,
    /// The cone.
    pub cone: Option<Cone>,
    /// Ovality e = (c, s): the cross-section's radius is larger by the factor 1 + c·cos 2φ + s·sin 2φ.
    pub ovality: [f64; 2],
}

/// A cone that opens upwards: ρ = m·(z_a − z).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cone {
    /// m, radius gained per metre of height.
    pub slope: f64,
    /// z_a of the vertex in the silo frame, metres.
    pub apex: f64,
}

impl Cone {
    /// The cone with a slope m whose radius at the camera's height is m·z_a, metres.
    pub fn with_intercept(slope: f64, intercept: f64) -> Self {
        Self { slope, apex: intercept / slope }
    }

    /// Radius m·z_a of the cone at the camera's height, metres.
    pub fn intercept(&self) -> f64 {
        self.slope * self.apex
    }
}

/// How far surfaces that are near each other may differ; lengths as shares of the silo's size.
#[derive(Debug, Clone, Copy)]
pub struct Reach {
    /// Angle between the axes, radians.
    pub tilt: f64,
    /// Distance between the axes at the camera's height.
    pub shift: f64,
    /// Difference of the radii.
    pub radius: f64,
    /// Difference of the cones' slopes, metres of radius per metre of height.
    pub slope: f64,
    /// Difference of the vertices' heights.
    pub apex: f64,
}

impl SiloSurface {
    /// z where the cylinder meets the cone; infinite on the side of the missing part.
    pub fn cylinder_bottom(&self) -> f64 {
        match (self.radius, self.cone) {
            (Some(radius), Some(cone)) => cone.apex - radius / cone.slope,
            (Some(_), None) => f64::INFINITY,
            _ => f64::NEG_INFINITY,
        }
    }

    /// A length that tells how large the silo is: its radius, or the cone's radius halfway to the camera's height.
    pub fn size(&self) -> f64 {
        self.radius.or(self.cone.map(|c| 0.5 * c.intercept().abs())).unwrap_or(1.0)
    }

    /// The surface without a part.
    pub fn without(self, part: Option<Part>) -> Self {
        match part {
            Some(Part::Cylinder) => Self { radius: None, ..self },
            Some(Part::Cone) => Self { cone: None, ..self },
            None => self,
        }
    }

    /// Whether it has the same parts as another one, and in the same place.
    pub fn is_near(&self, other: &Self, reach: &Reach) -> bool {
        let size = other.size();
        let near = |a: Option<f64>, b: Option<f64>, reach: f64| match (a, b) {
            (Some(a), Some(b)) => (a - b).abs() < reach,
            (a, b) => a.is_none() && b.is_none(),
        };
        let (a, b) = (&self.pose, &other.pose);
        (a.r_x - b.r_x).hypot(a.r_y - b.r_y) < reach.tilt
            && (a.t_x - b.t_x).hypot(a.t_y - b.t_y) < reach.shift * size
            && near(self.radius, other.radius, reach.radius * size)
            && near(self.cone.map(|c| c.slope), other.cone.map(|c| c.slope), reach.slope)
            && near(self.cone.map(|c| c.apex), other.cone.map(|c| c.apex), reach.apex * size)
    }

    /// Adds a step of the fit; the depth bias is not part of the surface.
    pub fn stepped(&self, step: &Parameters) -> Self {
        Self {
            pose: SiloPose {
                r_x: self.pose.r_x + step[0],
                r_y: self.pose.r_y + step[1],
                t_x: self.pose.t_x + step[2],
                t_y: self.pose.t_y + step[3],
            },
            radius: self.radius.map(|r| r + step[4]),
            cone: self.cone.map(|c| Cone::with_intercept(c.slope + step[5], c.intercept() + step[6])),
            ovality: [self.ovality[0] + step[10], self.ovality[1] + step[11]],
        }
    }
}

/// A surface with its rotation matrices worked out, for use on many points.
#[derive(Debug, Clone)]
pub struct PlacedSurface {
    /// The surface.
    pub surface: SiloSurface,
    bottom: f64,
    rotation: Matrix3<f64>,
    d_rx: Matrix3<f64>,
    d_ry: Matrix3<f64>,
    /// −1 where the camera is inside (the usual case), +1 where it looks at the wall from outside.
    root: f64,
    /// Constant terms of the ray equations: of the cylinder, and of the cone (m², m²·z_a, the rest).
    cylinder_c: f64,
    cone_m2: f64,
    cone_b: f64,
    cone_c: f64,
}

/// A place on or near the wall: the implicit function there and its gradient.
#[derive(Debug, Clone, Copy)]
pub struct Local {
    /// Which part.
    pub part: Part,
    /// The point in the silo frame.
    pub p: Vec3,
    /// Value of the implicit function F.
    pub value: f64,
    /// Gradient of F in the silo frame; its radial component is 1.
    pub gradient: Vec3,
    /// cos 2φ and sin 2φ of the azimuth φ.
    pub double_angle: [f64; 2],
    /// The ovality's factor 1 + c·cos 2φ + s·sin 2φ.
    pub oval: f64,
}

impl PlacedSurface {
    /// Works out the matrices of a surface.
    pub fn new(surface: SiloSurface) -> Self {
        let SiloPose { r_x, r_y, t_x, t_y } = surface.pose;
        let (sx, cx) = r_x.sin_cos();
        let (sy, cy) = r_y.sin_cos();
        let (m2, apex) = surface.cone.map_or((f64::NAN, f64::NAN), |c| (c.slope * c.slope, c.apex));
        let outside = surface.radius.is_some_and(|r| t_x.hypot(t_y) > r);
        Self {
            surface,
            bottom: surface.cylinder_bottom(),
            rotation: surface.pose.rotation(),
            d_rx: Matrix3::new(0.0, cx * sy, -sx * sy, 0.0, -sx, -cx, 0.0, cx * cy, -sx * cy),
            d_ry: Matrix3::new(-sy, sx * cy, cx * cy, 0.0, 0.0, 0.0, -cy, -sx * sy, -cx * sy),
            root: if outside { 1.0 } else { -1.0 },
            cylinder_c: surface.radius.map_or(f64::NAN, |r| t_x * t_x + t_y * t_y - r * r),
            cone_m2: m2,
            cone_b: m2 * apex,
            cone_c: t_x * t_x + t_y * t_y - m2 * apex * apex,
        }
    }

    /// A direction from the camera frame to the silo frame.
    #[inline]
    pub fn turn(&self, direction: &Vec3) -> Vec3 {
        self.rotation * direction
    }

    /// A point from the camera frame to the silo frame.
    #[inline]
    pub fn to_silo(&self, p: &Vec3) -> Vec3 {
        let turned = self.rotation * p;
        Vec3::new(turned.x + self.surface.pose.t_x, turned.y + self.surface.pose.t_y, turned.z)
    }

    /// z where the cylinder ends.
    #[inline]
    pub fn bottom(&self) -> f64 {
        self.bottom
    }

    /// The implicit function at a point of the camera frame, of the part that is there at its height.
    #[inline]
    pub fn local(&self, p_camera: &Vec3) -> Local {
        self.local_in_silo(self.to_silo(p_camera))
    }

    /// The same at depth `d` on a ray whose direction is already turned into the silo frame.
    #[inline(always)]
    pub fn local_along(&self, turned: &Vec3, d: f64) -> Local {
        let SiloPose { t_x, t_y, .. } = self.surface.pose;
        self.local_in_silo(Vec3::new(turned.x * d + t_x, turned.y * d + t_y, turned.z * d))
    }

    #[inline(always)]
    fn local_in_silo(&self, p: Vec3) -> Local {
        self.local_of(p, if p.z < self.bottom { Part::Cylinder } else { Part::Cone })
    }

    /// The implicit function of a given part at a point of the silo frame; the other part where that one is missing.
    #[inline(always)]
    pub fn local_of(&self, p: Vec3, part: Part) -> Local {
        let rho = (p.x * p.x + p.y * p.y).sqrt().max(1e-12); // lengths here are far from overflow: no hypot needed
        let inverse = 1.0 / rho;
        let [x, y] = [p.x * inverse, p.y * inverse];
        let (part, radius, rise) = match (part, self.surface.radius, self.surface.cone) {
            (Part::Cone, _, Some(cone)) | (Part::Cylinder, None, Some(cone)) => {
                (Part::Cone, cone.slope * (cone.apex - p.z), cone.slope)
            }
            (_, radius, _) => (Part::Cylinder, radius.unwrap_or(f64::NAN), 0.0),
        };
        let [c, s] = self.surface.ovality;
        let (cos, sin) = (x * x - y * y, 2.0 * x * y);
        let oval = 1.0 + c * cos + s * sin;
        let around = -2.0 * radius * inverse * (s * cos - c * sin); // ∂F/∂φ, divided by ρ
        Local {
            part,
            p,
            value: rho - radius * oval,
            gradient: Vec3::new(x - around * y, y + around * x, rise * oval),
            double_angle: [cos, sin],
            oval,
        }
    }

    /// Derivative of F at a point (camera frame and its `Local`) with respect to the parameters.
    #[inline(always)]
    pub fn derivative(&self, p_camera: &Vec3, at: &Local) -> Parameters {
        let g = &at.gradient;
        let mut d = Parameters::zeros();
        (d[0], d[1]) = (g.dot(&(self.d_rx * p_camera)), g.dot(&(self.d_ry * p_camera)));
        (d[2], d[3]) = (g.x, g.y);
        let radius = match (at.part, self.surface.cone) {
            (Part::Cone, Some(cone)) => {
                (d[5], d[6]) = (at.p.z * at.oval, -at.oval);
                cone.slope * (cone.apex - at.p.z)
            }
            _ => {
                d[4] = -at.oval;
                self.surface.radius.unwrap_or(0.0)
            }
        };
        (d[10], d[11]) = (-radius * at.double_angle[0], -radius * at.double_angle[1]);
        d
    }

    /// How the axis' point at height z moves along x and y with the parameters: the turn's share and the shift's.
    pub fn axis_shift(&self, z: f64) -> [Parameters; 2] {
        let SiloPose { t_x, t_y, .. } = self.surface.pose;
        let camera = self.rotation.transpose() * Vec3::new(-t_x, -t_y, z);
        let (by_rx, by_ry) = (self.d_rx * camera, self.d_ry * camera);
        [0, 1].map(|k| {
            let mut row = Parameters::zeros();
            (row[0], row[1], row[2 + k]) = (by_rx[k], by_ry[k], 1.0);
            row
        })
    }

    /// True depth at which the ray with direction `q` (camera frame, z = 1) meets the wall, and on which part.
    ///
    /// NaN where the ray misses.
    #[inline]
    pub fn depth(&self, q: &Vec3) -> (f64, Part) {
        let ray = [q.x, q.y];
        let cylinder = self.rounded(ray, self.cylinder_depth(ray), Part::Cylinder);
        if self.surface.cone.is_none() || cylinder * self.down(ray) < self.bottom {
            (cylinder, Part::Cylinder)
        } else {
            (self.rounded(ray, self.cone_depth(ray), Part::Cone), Part::Cone)
        }
    }

    /// The depth on the oval wall from that on the round one: three Newton steps, none where there is no ovality.
    #[inline]
    pub fn rounded(&self, ray: [f64; 2], mut d: f64, part: Part) -> f64 {
        if self.surface.ovality == [0.0; 2] {
            return d;
        }
        let q = Vec3::new(ray[0], ray[1], 1.0);
        let turned = self.turn(&q);
        for _ in 0..3 {
            let at = self.local_of(self.to_silo(&(q * d)), part);
            d -= at.value / at.gradient.dot(&turned);
        }
        d
    }

    /// True depth at which the ray `(x, y, 1)` of the camera frame meets the endless cylinder; NaN where it misses.
    #[inline]
    pub fn cylinder_depth(&self, ray: [f64; 2]) -> f64 {
        let q = self.turn_ray(ray);
        let SiloPose { t_x, t_y, .. } = self.surface.pose;
        let a = q[0] * q[0] + q[1] * q[1];
        let b = t_x * q[0] + t_y * q[1];
        (-b - self.root * (b * b - a * self.cylinder_c).sqrt()) / a
    }

    /// True depth at which the ray `(x, y, 1)` of the camera frame meets the endless cone; NaN where it misses.
    #[inline]
    pub fn cone_depth(&self, ray: [f64; 2]) -> f64 {
        let q = self.turn_ray(ray);
        let SiloPose { t_x, t_y, .. } = self.surface.pose;
        let a = q[0] * q[0] + q[1] * q[1] - self.cone_m2 * q[2] * q[2];
        let b = t_x * q[0] + t_y * q[1] + self.cone_b * q[2];
        -self.cone_c / (b + (b * b - a * self.cone_c).sqrt())
    }

    /// Height in the silo frame gained per metre of depth along the ray `(x, y, 1)` of the camera frame.
    #[inline]
    pub fn down(&self, [x, y]: [f64; 2]) -> f64 {
        self.rotation[(2, 0)] * x + self.rotation[(2, 1)] * y + self.rotation[(2, 2)]
    }

    #[inline]
    fn turn_ray(&self, [x, y]: [f64; 2]) -> [f64; 3] {
        let r = &self.rotation;
        [0, 1, 2].map(|k| r[(k, 0)] * x + r[(k, 1)] * y + r[(k, 2)])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn silo(r_x: f64, r_y: f64, t_x: f64, t_y: f64) -> SiloSurface {
        SiloSurface {
            pose: SiloPose { r_x, r_y, t_x, t_y },
            radius: Some(1.25),
            cone: Some(Cone { slope: 0.8, apex: 5.0 }),
            ovality: [0.004, -0.003],
        }
    }

    proptest! {
        /// So no step along what a frame leaves open of the cone leaves the valley of its likelihood.
        #[test]
        fn a_step_of_the_cone_changes_its_radius_as_the_derivative_says(
            slope in -0.3..0.3f64, intercept in -2.0..2.0f64, x in 0.1..1.2f64, z in 3.5..4.9f64,
        ) {
            let surface = silo(0.1, -0.2, 0.3, 0.4);
            let (placed, mut step) = (PlacedSurface::new(surface), Parameters::zeros());
            (step[5], step[6]) = (slope, intercept);
            let at = placed.local_of(Vec3::new(x, 0.5 * x, z), Part::Cone);
            let stepped = PlacedSurface::new(surface.stepped(&step)).local_of(at.p, Part::Cone);
            let told = at.value + placed.derivative(&Vec3::zeros(), &at).dot(&step);
            prop_assert!((stepped.value - told).abs() < 1e-12, "{} {told}", stepped.value);
        }

        #[test]
        fn rays_end_on_the_wall(
            r_x in -0.4..0.4f64, r_y in -0.4..0.4f64, t_x in -0.8..0.8f64, t_y in -0.8..0.8f64,
            x in -0.5..0.5f64, y in -0.4..0.4f64,
        ) {
            let placed = PlacedSurface::new(silo(r_x, r_y, t_x, t_y));
            let q = Vec3::new(x, y, 1.0);
            let (d, part) = placed.depth(&q);
            prop_assume!(d.is_finite());
            let at = placed.local(&(q * d));
            prop_assert!(d > 0.0 && at.part == part && at.value.abs() < 1e-7, "{d} {at:?}");
        }

        #[test]
        fn derivatives_match_finite_differences(
            r_x in -0.4..0.4f64, r_y in -0.4..0.4f64, t_x in -0.8..0.8f64, t_y in -0.8..0.8f64,
            x in -0.5..0.5f64, y in -0.4..0.4f64,
        ) {
            let surface = silo(r_x, r_y, t_x, t_y);
            let placed = PlacedSurface::new(surface);
            let q = Vec3::new(x, y, 1.0);
            let (d, part) = placed.depth(&q);
            prop_assume!(d.is_finite());
            let at = placed.local(&(q * d));
            let along = at.gradient.dot(&placed.turn(&q));
            prop_assume!(along.abs() > 1e-2);
            let analytic = placed.derivative(&(q * d), &at);
            let h = 1e-6;
            for k in [0, 1, 2, 3, 4, 5, 6, 10, 11] {
                let mut step = Parameters::zeros();
                step[k] = h;
                let above = PlacedSurface::new(surface.stepped(&step)).depth(&q);
                let below = PlacedSurface::new(surface.stepped(&-step)).depth(&q);
                prop_assume!(above.1 == part && below.1 == part);
                let numeric = (above.0 - below.0) / (2.0 * h);
                prop_assert!((numeric + analytic[k] / along).abs() < 1e-5 * (1.0 + numeric.abs()), "{k}: {numeric}");
            }
        }
    }
}
