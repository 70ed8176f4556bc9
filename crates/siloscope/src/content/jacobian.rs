//! How points and floor move when the calibration is a little wrong.

use crate::SiloPose;
use crate::geometry::sensor::DepthBias;
use crate::geometry::vessel::Vessel;
use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

/// Number of parameters of a calibration.
pub const PARAMETERS: usize = 10;

/// One number for each parameter: r_x, r_y, t_x, t_y, radius, cylinder_bottom, apex, and the depth bias's offset, scale
/// and quadratic part (`measured = d + offset + scale d + quadratic d²`).
pub type Parameters = SVector<f64, PARAMETERS>;

/// Covariance of the parameters.
pub type Covariance = SMatrix<f64, PARAMETERS, PARAMETERS>;

/// Parameters of the pose, of the geometry and of the depth bias.
pub const POSE: std::ops::Range<usize> = 0..4;
/// See `POSE`.
pub const GEOMETRY: std::ops::Range<usize> = 4..7;
/// See `POSE`.
pub const DEPTH: std::ops::Range<usize> = 7..10;

/// The pose's rotation and its derivatives, and the depth bias.
#[derive(Debug, Clone)]
pub struct CalibrationJacobian {
    bias: DepthBias,
    rotation: Matrix3<f64>,
    turned: [Matrix3<f64>; 2],
    translation: Vector3<f64>,
}

impl CalibrationJacobian {
    /// Works out the matrices of a pose.
    pub fn new(pose: &SiloPose, bias: DepthBias) -> Self {
        Self {
            bias,
            rotation: pose.rotation(),
            turned: pose.rotation_derivatives(),
            translation: Vector3::new(pose.t_x, pose.t_y, 0.0),
        }
    }

    /// Depth in the camera frame of a point of the silo frame.
    pub fn depth(&self, point: [f64; 3]) -> f64 {
        self.rotation.column(2).dot(&(Vector3::from(point) - self.translation))
    }

    /// How a point of the silo frame moves with its depth.
    pub fn ray(&self, point: [f64; 3]) -> [f64; 3] {
        let depth = self.depth(point);
        ((Vector3::from(point) - self.translation) / if depth.abs() > 1e-9 { depth } else { 1.0 }).into()
    }

    /// How much a measured depth changes with the true one.
    pub fn gain(&self, depth: f64) -> f64 {
        self.bias.slope(depth)
    }

    /// Derivatives by the parameters of where a measured point comes to lie in the silo frame.
    pub fn shifts(&self, point: [f64; 3]) -> [[f64; 3]; PARAMETERS] {
        let p_camera = self.rotation.transpose() * (Vector3::from(point) - self.translation);
        let (depth, ray) = (p_camera.z, Vector3::from(self.ray(point)));
        let [a, b] = self.turned.map(|turned| turned * p_camera);
        let bias = [1.0, depth, depth * depth].map(|part| (-part / self.gain(depth) * ray).into());
        let none = [0.0; 3];
        [a.into(), b.into(), [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], none, none, none, bias[0], bias[1], bias[2]]
    }

    /// Derivatives by the parameters of the height z that a surface with slopes `[dz/dx, dz/dy]` has at a fixed place.
    pub fn heights(&self, point: [f64; 3], slopes: [f64; 2]) -> Parameters {
        let fixed = |[x, y, z]: [f64; 3]| z - slopes[0] * x - slopes[1] * y;
        Parameters::from(self.shifts(point).map(fixed))
    }

    /// Derivatives by the parameters of how far a point lies above the cone.
    pub fn thickness(&self, point: [f64; 3], vessel: &Vessel) -> Parameters {
        let r = point[0].hypot(point[1]).max(1e-9);
        let fall = -vessel.cone_height() / vessel.radius / r;
        let by = vessel.cone_derivatives(r);
        let mut out = -self.heights(point, [fall * point[0], fall * point[1]]);
        out[4] += by.radius;
        out[5] += by.cylinder_bottom;
        out[6] += by.apex;
        out
    }
}

/// Standard deviation of a quantity with these derivatives.
pub fn deviation(derivatives: &Parameters, covariance: &Covariance) -> f64 {
    derivatives.dot(&(covariance * derivatives)).max(0.0).sqrt()
}

/// Standard deviation by some of the parameters alone.
pub fn share(derivatives: &Parameters, covariance: &Covariance, part: std::ops::Range<usize>) -> f64 {
    let mut own = Parameters::zeros();
    for i in part {
        own[i] = derivatives[i];
    }
    deviation(&own, covariance)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn vessel() -> Vessel {
        Vessel {
            radius: 1.2,
            cylinder_bottom: 2.0,
            apex: 3.4,
            top: 0.0,
            outlet_radius: 0.0,
            outlet_length: 0.0,
            ovality: [0.0; 2],
        }
    }

    const BIAS: DepthBias = DepthBias { offset: 3.4397e-3, scale: -0.017878, quadratic: 2.2093e-2 };

    /// A measured point under changed parameters, the floor with it.
    fn moved(change: &Parameters, ray: [f64; 2], measured: f64) -> ([f64; 3], Vessel) {
        let pose = SiloPose { r_x: 0.1 + change[0], r_y: -0.2 + change[1], t_x: 0.4 + change[2], t_y: 0.1 + change[3] };
        let bias = DepthBias {
            offset: BIAS.offset + change[7],
            scale: BIAS.scale + change[8],
            quadratic: BIAS.quadratic + change[9],
        };
        let p = pose.to_silo(&(Vector3::new(ray[0], ray[1], 1.0) * bias.true_depth(measured)));
        let v = vessel();
        let changed = Vessel {
            radius: v.radius + change[4],
            cylinder_bottom: v.cylinder_bottom + change[5],
            apex: v.apex + change[6],
            ..v
        };
        (p.into(), changed)
    }

    proptest! {
        #[test]
        fn derivatives_are_finite_differences(x in -0.4f64..0.4, y in -0.3f64..0.3, d in 1.0f64..3.0, k in 0usize..10) {
            let pose = SiloPose { r_x: 0.1, r_y: -0.2, t_x: 0.4, t_y: 0.1 };
            let (p, v) = moved(&Parameters::zeros(), [x, y], d);
            prop_assume!(p[0].hypot(p[1]) > 0.05);
            let by = CalibrationJacobian::new(&pose, BIAS).thickness(p, &v)[k];
            let h = 1e-6;
            let thickness = |step: f64| {
                let mut change = Parameters::zeros();
                change[k] = step;
                let (p, v) = moved(&change, [x, y], d);
                v.cone(p[0].hypot(p[1])) - p[2]
            };
            prop_assert!((by - (thickness(h) - thickness(-h)) / (2.0 * h)).abs() < 1e-6);
        }
    }

    #[test]
    fn a_share_is_the_deviation_by_those_parameters_alone() {
        let covariance = Covariance::from_diagonal(&Parameters::from_fn(|i, _| (i + 1) as f64));
        let derivatives = Parameters::repeat(1.0);
        assert!((share(&derivatives, &covariance, GEOMETRY) - 18f64.sqrt()).abs() < 1e-12);
        assert!((deviation(&derivatives, &covariance) - 55f64.sqrt()).abs() < 1e-12);
    }
}
