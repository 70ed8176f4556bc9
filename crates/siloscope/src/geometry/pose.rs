//! The transform from the camera to the silo (Eqs. 5–7).

use crate::Vec3;
use nalgebra::{Matrix3, Matrix4};

/// Pose of a camera in the silo frame in the paper's two-angle form: `R = Ry(r_y)·Rx(r_x)`, translation `(t_x, t_y, 0)`.
///
/// The turn about the axis can't be seen on a surface of revolution; the two-angle form fixes it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SiloPose {
    /// Rotation about the x-axis, radians.
    pub r_x: f64,
    /// Rotation about the y-axis, radians.
    pub r_y: f64,
    /// Translation along the silo's x-axis, metres.
    pub t_x: f64,
    /// Translation along the silo's y-axis, metres.
    pub t_y: f64,
}

impl SiloPose {
    /// Pose from the axis direction `X` and any point `a` on the axis, both in the camera frame (Eqs. 6 and 7).
    ///
    /// `X` may have any length and either sign: an axis has no sign, so the one with z > 0 is taken.
    pub fn from_axis(direction: &Vec3, point: &Vec3) -> Self {
        let x = direction.normalize() * if direction.z < 0.0 { -1.0 } else { 1.0 };
        let mut pose = Self {
            r_x: x.y.atan2(x.z), // equals asin(y / sqrt(1 - x²)) for z > 0, and is defined at x = ±1
            r_y: (-x.x).clamp(-1.0, 1.0).asin(),
            t_x: 0.0,
            t_y: 0.0,
        };
        let a = pose.rotation() * point; // the component along the axis drops out here
        pose.t_x = -a.x;
        pose.t_y = -a.y;
        pose
    }

    /// Rotation part of `T_silo_camera` (Eq. 5).
    pub fn rotation(&self) -> Matrix3<f64> {
        let (sx, cx) = self.r_x.sin_cos();
        let (sy, cy) = self.r_y.sin_cos();
        Matrix3::new(cy, sx * sy, cx * sy, 0.0, cx, -sx, -sy, sx * cy, cx * cy)
    }

    /// Derivatives of the rotation by r_x and by r_y.
    pub fn rotation_derivatives(&self) -> [Matrix3<f64>; 2] {
        let (sx, cx) = self.r_x.sin_cos();
        let (sy, cy) = self.r_y.sin_cos();
        [
            Matrix3::new(0.0, cx * sy, -sx * sy, 0.0, -sx, -cx, 0.0, cx * cy, -sx * cy),
            Matrix3::new(-sy, sx * cy, cx * cy, 0.0, 0.0, 0.0, -cy, -sx * sy, -cx * sy),
        ]
    }

    /// Homogeneous transform with `p_silo = T_silo_camera · p_camera` (Eq. 5).
    #[allow(non_snake_case)]
    pub fn T_silo_camera(&self) -> Matrix4<f64> {
        let mut t = self.rotation().to_homogeneous();
        t[(0, 3)] = self.t_x;
        t[(1, 3)] = self.t_y;
        t
    }

    /// A point from the camera frame to the silo frame.
    pub fn to_silo(&self, p_camera: &Vec3) -> Vec3 {
        self.rotation() * p_camera + Vec3::new(self.t_x, self.t_y, 0.0)
    }

    /// Unit direction `X` of the axis in the camera frame, along gravity.
    pub fn axis_direction(&self) -> Vec3 {
        self.rotation().row(2).transpose()
    }

    /// The axis point `a` in the camera frame, in the plane through the camera perpendicular to `X`.
    pub fn axis_point(&self) -> Vec3 {
        self.rotation().transpose() * Vec3::new(-self.t_x, -self.t_y, 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn axis_and_pose_are_inverse(r_x in -1.4..1.4f64, r_y in -1.4..1.4f64, t_x in -5.0..5.0f64, t_y in -5.0..5.0f64) {
            let pose = SiloPose { r_x, r_y, t_x, t_y };
            let back = SiloPose::from_axis(&(pose.axis_direction() * -3.0), &(pose.axis_point() + pose.axis_direction() * 7.0));
            for (a, b) in [(back.r_x, r_x), (back.r_y, r_y), (back.t_x, t_x), (back.t_y, t_y)] {
                prop_assert!((a - b).abs() < 1e-12);
            }
        }

        #[test]
        fn the_axis_becomes_z(r_x in -1.4..1.4f64, r_y in -1.4..1.4f64, t_x in -5.0..5.0f64, t_y in -5.0..5.0f64) {
            let pose = SiloPose { r_x, r_y, t_x, t_y };
            let p = pose.to_silo(&(pose.axis_point() + pose.axis_direction() * 2.0));
            prop_assert!((p - Vec3::new(0.0, 0.0, 2.0)).norm() < 1e-12);
            let sin_rx = pose.axis_direction().y / (1.0 - pose.axis_direction().x.powi(2)).sqrt();
            prop_assert!((sin_rx.asin() - r_x).abs() < 1e-9, "Eq. 6 as printed");
        }
    }
}
