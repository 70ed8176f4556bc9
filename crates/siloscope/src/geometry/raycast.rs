//! Rays against the wall: the depth at which a ray of the camera meets cylinder and cone.

use crate::geometry::evaluator::SurfaceEvaluator;
use crate::geometry::surface::Part;
use crate::{SiloPose, Vec3};

impl SurfaceEvaluator {
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
