//! A surface evaluated at many points: its implicit function, the gradient, and derivatives by the parameters.

use crate::geometry::parameters::Parameters;
use crate::geometry::surface::{Part, SiloSurface};
use crate::{SiloPose, Vec3};
use nalgebra::Matrix3;

/// A surface with its rotation matrices worked out, for use on many points.
#[derive(Debug, Clone)]
pub struct SurfaceEvaluator {
    /// The surface.
    pub surface: SiloSurface,
    pub(super) bottom: f64,
    pub(super) rotation: Matrix3<f64>,
    d_rx: Matrix3<f64>,
    d_ry: Matrix3<f64>,
    /// −1 where the camera is inside (the usual case), +1 where it looks at the wall from outside.
    pub(super) root: f64,
    /// Constant terms of the ray equations: of the cylinder, and of the cone (m², m²·z_a, the rest).
    pub(super) cylinder_c: f64,
    pub(super) cone_m2: f64,
    pub(super) cone_b: f64,
    pub(super) cone_c: f64,
}

/// A place on or near the wall: the implicit function there and its gradient.
#[derive(Debug, Clone, Copy)]
pub struct ImplicitSample {
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

impl SurfaceEvaluator {
    /// Works out the matrices of a surface.
    pub fn new(surface: SiloSurface) -> Self {
        let SiloPose { t_x, t_y, .. } = surface.pose;
        let [d_rx, d_ry] = surface.pose.rotation_derivatives();
        let (m2, apex) = surface.cone.map_or((f64::NAN, f64::NAN), |c| (c.slope * c.slope, c.apex));
        let outside = surface.radius.is_some_and(|r| t_x.hypot(t_y) > r);
        Self {
            surface,
            bottom: surface.cylinder_bottom(),
            rotation: surface.pose.rotation(),
            d_rx,
            d_ry,
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
    pub fn local(&self, p_camera: &Vec3) -> ImplicitSample {
        self.local_in_silo(self.to_silo(p_camera))
    }

    /// The same at depth `d` on a ray whose direction is already turned into the silo frame.
    #[inline(always)]
    pub fn local_along(&self, turned: &Vec3, d: f64) -> ImplicitSample {
        let SiloPose { t_x, t_y, .. } = self.surface.pose;
        self.local_in_silo(Vec3::new(turned.x * d + t_x, turned.y * d + t_y, turned.z * d))
    }

    #[inline(always)]
    fn local_in_silo(&self, p: Vec3) -> ImplicitSample {
        self.local_of(p, if p.z < self.bottom { Part::Cylinder } else { Part::Cone })
    }

    /// The implicit function of a given part at a point of the silo frame; the other part where that one is missing.
    #[inline(always)]
    pub fn local_of(&self, p: Vec3, part: Part) -> ImplicitSample {
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
        ImplicitSample {
            part,
            p,
            value: rho - radius * oval,
            gradient: Vec3::new(x - around * y, y + around * x, rise * oval),
            double_angle: [cos, sin],
            oval,
        }
    }

    /// Derivative of F at a point (camera frame and its `ImplicitSample`) with respect to the parameters.
    #[inline(always)]
    pub fn derivative(&self, p_camera: &Vec3, at: &ImplicitSample) -> Parameters {
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
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::surface::Cone;
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
            let (placed, mut step) = (SurfaceEvaluator::new(surface), Parameters::zeros());
            (step[5], step[6]) = (slope, intercept);
            let at = placed.local_of(Vec3::new(x, 0.5 * x, z), Part::Cone);
            let stepped = SurfaceEvaluator::new(surface.stepped(&step)).local_of(at.p, Part::Cone);
            let told = at.value + placed.derivative(&Vec3::zeros(), &at).dot(&step);
            prop_assert!((stepped.value - told).abs() < 1e-12, "{} {told}", stepped.value);
        }

        #[test]
        fn rays_end_on_the_wall(
            r_x in -0.4..0.4f64, r_y in -0.4..0.4f64, t_x in -0.8..0.8f64, t_y in -0.8..0.8f64,
            x in -0.5..0.5f64, y in -0.4..0.4f64,
        ) {
            let placed = SurfaceEvaluator::new(silo(r_x, r_y, t_x, t_y));
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
            let placed = SurfaceEvaluator::new(surface);
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
                let above = SurfaceEvaluator::new(surface.stepped(&step)).depth(&q);
                let below = SurfaceEvaluator::new(surface.stepped(&-step)).depth(&q);
                prop_assume!(above.1 == part && below.1 == part);
                let numeric = (above.0 - below.0) / (2.0 * h);
                prop_assert!((numeric + analytic[k] / along).abs() < 1e-5 * (1.0 + numeric.abs()), "{k}: {numeric}");
            }
        }
    }
}
