//! Whether the wall still lies where the calibration has it.

use super::fit::Surface;
use super::jacobian::{CalibrationJacobian, Covariance, DEPTH, POSE};
use super::silo_points::SiloPoints;
use crate::geometry::sensor::NoiseLaw;
use crate::geometry::vessel::Vessel;
use crate::stats::robust::{TUKEY, tukey_weight};
use nalgebra::{Matrix4, Vector4};

/// How far the wall seems to have moved, as a change of the camera's pose (r_x, r_y, t_x, t_y).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shift {
    /// The change.
    pub change: [f64; 4],
    /// Its standard deviations: the fit's own and the calibration's.
    pub std: [f64; 4],
    /// Root of the mean square distance of the wall's returns from where the calibration has the wall, metres.
    pub rms: f64,
    /// The same when the change is taken out.
    pub left: f64,
}

/// SiloPoints looked at.
const SAMPLED: f64 = 2_500.0;
/// SiloPoints farther from the wall than this share of the radius don't belong to it.
const GATE: f64 = 0.08;
/// Wall closer above the content than this share of the radius may be content.
const CLEARANCE: f64 = 0.1;
/// Unevenness of a wall over short distances, metres: what a return's distance scatters beside the sensor's noise.
const UNEVEN: f64 = 0.005;
/// Rounds of reweighting.
const ROUNDS: usize = 4;
/// Fewest returns that tell.
const FEWEST: usize = 60;

/// One return near the wall: its distance outwards, how that changes with the pose, and its standard deviation.
struct Residual {
    distance: f64,
    by_pose: Vector4<f64>,
    sigma: f64,
}

impl Residual {
    /// The distance when the pose has changed.
    fn after(&self, change: &Vector4<f64>) -> f64 {
        self.distance + self.by_pose.dot(change)
    }
}

/// Fits the pose's change to the returns near the cylinder's wall; None where they are too few to tell.
pub fn shift(
    returns: &SiloPoints<'_>,
    vessel: &Vessel,
    jacobian: &CalibrationJacobian,
    noise: &NoiseLaw,
    covariance: &Covariance,
    surface: Option<&Surface>,
) -> Option<Shift> {
    let residuals = near_wall(returns, vessel, jacobian, noise, surface);
    if residuals.len() < FEWEST {
        return None;
    }
    let mut change = Vector4::zeros();
    let mut normal = Matrix4::zeros();
    for _ in 0..ROUNDS {
        let right;
        (normal, right) = normal_equations(&residuals, &change);
        change = normal.cholesky()?.solve(&right);
    }
    let own = normal.try_inverse()?;
    Some(Shift {
        change: change.into(),
        std: POSE.map(|i| (own[(i, i)] + covariance[(i, i)]).max(0.0).sqrt()).collect::<Vec<_>>().try_into().ok()?,
        rms: rms(&residuals, &Vector4::zeros()),
        left: rms(&residuals, &change),
    })
}

/// Sums of the least squares, with Tukey's weights by what the change found so far leaves.
fn normal_equations(residuals: &[Residual], change: &Vector4<f64>) -> (Matrix4<f64>, Vector4<f64>) {
    let (mut normal, mut right) = (Matrix4::identity() * 1e-6, Vector4::zeros());
    for r in residuals {
        let left = r.after(change) / r.sigma;
        let weight = tukey_weight(left * left, TUKEY) / (r.sigma * r.sigma);
        normal += weight * r.by_pose * r.by_pose.transpose();
        right -= weight * r.by_pose * r.distance;
    }
    (normal, right)
}

fn rms(residuals: &[Residual], change: &Vector4<f64>) -> f64 {
    (residuals.iter().map(|r| r.after(change).powi(2)).sum::<f64>() / residuals.len() as f64).sqrt()
}

fn near_wall(
    returns: &SiloPoints<'_>,
    vessel: &Vessel,
    jacobian: &CalibrationJacobian,
    noise: &NoiseLaw,
    surface: Option<&Surface>,
) -> Vec<Residual> {
    let stride = (returns.len() as f64 / SAMPLED).sqrt().round().max(1.0) as usize;
    let mut residuals = Vec::new();
    returns.visit(stride, |line| {
        for i in (0..line.len()).filter(|&i| line.depth[i] > 0.0) {
            let point = [line.x[i], line.y[i], line.z[i]].map(f64::from);
            if on_cylinder(vessel, surface, point) {
                residuals.push(residual(vessel, jacobian, noise, point, f64::from(line.depth[i])));
            }
        }
    });
    residuals
}

/// Whether a return may be the cylinder's wall: near it, clear of the cone and of the content.
fn on_cylinder(vessel: &Vessel, surface: Option<&Surface>, [x, y, z]: [f64; 3]) -> bool {
    let gate = GATE * vessel.radius;
    let near = (x.hypot(y) - vessel.radius).abs() < gate && z > vessel.top && z < vessel.cylinder_bottom - gate;
    near && surface.is_none_or(|s| s.height(x, y) - z >= CLEARANCE * vessel.radius)
}

fn residual(
    vessel: &Vessel,
    jacobian: &CalibrationJacobian,
    noise: &NoiseLaw,
    point: [f64; 3],
    depth: f64,
) -> Residual {
    let radius = point[0].hypot(point[1]);
    let out = [point[0] / radius, point[1] / radius];
    let shifts = jacobian.shifts(point);
    let along = |k: usize| out[0] * shifts[k][0] + out[1] * shifts[k][1];
    let grazing = along(DEPTH.start).abs() * noise.sigma(depth);
    Residual {
        distance: radius - vessel.radius,
        by_pose: Vector4::new(along(0), along(1), along(2), along(3)),
        sigma: grazing.hypot(UNEVEN),
    }
}
