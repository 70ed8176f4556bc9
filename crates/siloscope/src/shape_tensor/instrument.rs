//! What the sensor's own errors do to an axis: the six steps take depth and camera as they are told.
//!
//! An error of the focal lengths, of the principal point or of the depth's scale maps space linearly, and with it every
//! line on the wall: the axis goes along. Any other one bends the wall, and the steps run again on the points without it.

use crate::base::refusal::Refusal;
use crate::geometry::sensor::DepthBias;
use crate::{SiloPose, Vec3};
use nalgebra::{Matrix3, Vector4};

/// What is known of the errors of a sensor and its camera.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SensorErrors {
    /// Systematic depth error, which is left in the points.
    pub bias: DepthBias,
    /// Standard deviations of its offset, scale and quadratic part.
    pub bias_std: [f64; 3],
    /// Standard deviations of the focal lengths (relative), the principal point (rays) and k1.
    pub camera_std: [f64; 5],
}

impl SensorErrors {
    /// The linear maps by one standard deviation of each error that is one.
    fn maps(&self) -> Vec<Matrix3<f64>> {
        let [fx, fy, cx, cy, _] = self.camera_std;
        let of = |entries: &[(usize, usize, f64)]| {
            let mut map = Matrix3::identity();
            entries.iter().for_each(|&(r, c, value)| map[(r, c)] += value);
            map
        };
        let scale = self.bias_std[1];
        let one = |r: usize, c: usize, std: f64| (std > 0.0).then(|| of(&[(r, c, std)]));
        let all = (scale > 0.0).then(|| of(&[(0, 0, scale), (1, 1, scale), (2, 2, scale)]));
        [one(0, 0, fx), one(1, 1, fy), one(0, 2, cx), one(1, 2, cy), all].into_iter().flatten().collect()
    }

    /// The errors that bend the wall: the known one, and one standard deviation of each that may be.
    fn bends(&self) -> Vec<Bend> {
        let known = (self.bias != DepthBias::default()).then_some(Bend { bias: self.bias, k1: 0.0 });
        let offset = DepthBias { offset: self.bias_std[0], ..DepthBias::default() };
        let quadratic = DepthBias { quadratic: self.bias_std[2], ..DepthBias::default() };
        let may_be = [(offset, 0.0), (quadratic, 0.0), (DepthBias::default(), self.camera_std[4])];
        let some = |&(bias, k1): &(DepthBias, f64)| bias != DepthBias::default() || k1 > 0.0;
        let may_be = may_be.into_iter().filter(some).map(|(bias, k1)| Bend { bias, k1 });
        known.into_iter().chain(may_be).collect()
    }
}

/// An error of the depth, or of the lens.
struct Bend {
    bias: DepthBias,
    k1: f64,
}

impl Bend {
    /// Where a point would be without the error.
    fn without(&self, p: &Vec3) -> Vec3 {
        let depth = self.bias.true_depth(p.z);
        let (x, y) = (p.x / p.z, p.y / p.z);
        let lens = 1.0 - self.k1 * (x * x + y * y);
        Vec3::new(x * lens, y * lens, 1.0) * depth
    }
}

/// A cloud with its normals, and its axis.
pub struct Placed {
    /// Points, metres.
    pub points: Vec<Vec3>,
    /// Their unit normals.
    pub normals: Vec<Vec3>,
    /// The pose by its axis.
    pub pose: SiloPose,
}

/// The answers without one standard deviation of each error, one after the other; `again` runs the steps on other points.
///
/// Refused where the steps find no axis without one of them.
pub fn without_each(
    errors: &SensorErrors,
    found: &Placed,
    again: impl Fn(Vec<Vec3>) -> Result<Placed, Refusal>,
) -> Result<Vec<Placed>, Refusal> {
    let along = errors.maps().into_iter().map(|map| Ok(along(found, &map)));
    let bent = errors.bends().into_iter().map(|bend| {
        let points = found.points.iter().map(|p| bend.without(p)).collect();
        again(points).map_err(|_| Refusal::PoorlyDetermined)
    });
    along.chain(bent).collect()
}

/// Everything as a linear map of space takes it along.
fn along(found: &Placed, map: &Matrix3<f64>) -> Placed {
    let turn = map.try_inverse().unwrap_or_else(Matrix3::identity).transpose();
    Placed {
        points: found.points.iter().map(|p| map * p).collect(),
        normals: found.normals.iter().map(|n| (turn * n).normalize()).collect(),
        pose: mapped(&found.pose, map),
    }
}

/// The step from one pose to another.
pub fn step_to(pose: &SiloPose, other: &SiloPose) -> Vector4<f64> {
    Vector4::new(other.r_x - pose.r_x, other.r_y - pose.r_y, other.t_x - pose.t_x, other.t_y - pose.t_y)
}

/// The pose whose axis is the image of another one's.
fn mapped(pose: &SiloPose, map: &Matrix3<f64>) -> SiloPose {
    SiloPose::from_axis(&(map * pose.axis_direction()), &(map * pose.axis_point()))
}

#[cfg(test)]
mod tests {
    use super::*;

    const POSE: SiloPose = SiloPose { r_x: 0.2, r_y: -0.3, t_x: 0.5, t_y: -0.1 };

    #[test]
    fn a_principal_point_that_is_off_turns_the_axis_by_its_ray() {
        let straight = SiloPose { r_x: 0.0, r_y: 0.0, t_x: 0.0, t_y: 0.0 };
        let errors = SensorErrors { camera_std: [0.0, 0.0, 0.002, 0.0, 0.0], ..SensorErrors::default() };
        let [map] = errors.maps()[..] else { panic!("one map") };
        let step = step_to(&straight, &mapped(&straight, &map));
        assert!((step - Vector4::new(0.0, -0.002, 0.0, 0.0)).norm() < 1e-8, "{step}");
    }

    #[test]
    fn another_scale_moves_the_camera_and_turns_nothing() {
        let errors = SensorErrors { bias_std: [0.0, 0.02, 0.0], ..SensorErrors::default() };
        let [map] = errors.maps()[..] else { panic!("one map") };
        let step = step_to(&POSE, &mapped(&POSE, &map));
        assert!((step - Vector4::new(0.0, 0.0, 0.01, -0.002)).norm() < 1e-12, "{step}");
    }

    #[test]
    fn a_point_without_an_error_is_measured_where_it_was() {
        let bias = DepthBias { offset: 0.003, scale: -0.02, quadratic: 0.02 };
        let p = Vec3::new(0.4, -0.3, 2.0);
        let without = Bend { bias, k1: 0.0 }.without(&p);
        assert!((bias.measured(without.z) - 2.0).abs() < 1e-12);
        assert!((without / without.z - p / p.z).norm() < 1e-12);
    }

    #[test]
    fn exact_sensors_share_nothing() {
        let errors = SensorErrors::default();
        assert!(errors.maps().is_empty() && errors.bends().is_empty());
    }
}
