//! What a wall's form leaves open of its axis and its radius.
//!
//! A wall in rings has no one radius: what is called so is known to the rings' own spread.
//!
//! The axis is the straight line through the wall, and which line that is depends on where the wall begins and ends. The
//! form's Legendre polynomials run from the camera's height to the joint, or to the lowest tiles. A wall that goes on by
//! fractions e₁ above and e₂ below of that height has another line: with u = (t + e₁ − e₂) / (1 + e₁ + e₂), the visible
//! coefficients c₂ and c₃ of P₂(u) and P₃(u) come with shares of P₀(t) and P₁(t), which the fit calls pose.

use crate::Vec3;
use crate::geometry::pose::SiloPose;
use crate::surface_fit::joint::parameters::{CYLINDER_FORM, JointState, RADIUS};
use nalgebra::{DMatrix, DVector, Matrix4, Vector4};
use std::ops::AddAssign;

/// Columns of the bend's degrees 2 and 3, cosine and sine.
const BEND: [usize; 4] = [RINGS, RINGS + 1, RINGS + 2, RINGS + 3];
/// The rings' columns come first, degrees 1 to 8.
const RINGS: usize = 8;
/// Cameras hang within so much of the wall's height of its upper end.
const ABOVE: f64 = 0.1;
/// How much wall may lie below the lowest tiles, where feed or a floor ends the view: none to as much again.
const BELOW: [f64; 3] = [0.0, 0.5, 1.0];
/// Step of the differences, metres.
const STEP: f64 = 1e-5;

/// Widens a covariance of all parameters by it; the form runs from the camera's height to the height `reference`.
pub fn widen(state: &JointState, reference: f64, mean: &DVector<f64>, covariance: &mut DMatrix<f64>) {
    if state.has_cylinder {
        let (pose, radius) = (axis(state, reference, mean, covariance), rings(mean, covariance));
        covariance.view_mut((0, 0), (4, 4)).add_assign(pose);
        covariance[(RADIUS, RADIUS)] += radius;
    }
}

/// Mean square of the rings over the height: Σ c_k² / (2k + 1).
fn rings(mean: &DVector<f64>, covariance: &DMatrix<f64>) -> f64 {
    let square = |k: usize| (mean[k].powi(2) + covariance[(k, k)]) / (2 * (k - CYLINDER_FORM) + 3) as f64;
    (CYLINDER_FORM..CYLINDER_FORM + RINGS).map(square).sum()
}

/// Covariance that the bend adds to the pose.
fn axis(state: &JointState, reference: f64, mean: &DVector<f64>, covariance: &DMatrix<f64>) -> Matrix4<f64> {
    let c = Vector4::from_fn(|k, _| mean[CYLINDER_FORM + BEND[k]]);
    let moment =
        c * c.transpose() + Matrix4::from_fn(|i, j| covariance[(CYLINDER_FORM + BEND[i], CYLINDER_FORM + BEND[j])]);
    let [shift, turn] = moved(&state.pose(), reference);
    let below = if state.has_cone { &BELOW[..1] } else { &BELOW };
    let mut sum = Matrix4::zeros();
    for above in [-ABOVE, ABOVE] {
        for below in below {
            let [second, third] = lines(above, *below);
            let by_coefficient = |k: usize, axis: usize| {
                let [p0, p1] = if k == 0 { second } else { third };
                shift[axis] * p0 + turn[axis] * p1
            };
            let map = Matrix4::from_columns(&[
                by_coefficient(0, 0),
                by_coefficient(0, 1),
                by_coefficient(1, 0),
                by_coefficient(1, 1),
            ]);
            sum += map * moment * map.transpose();
        }
    }
    sum / (2 * below.len()) as f64
}

/// Shares of P₀(t) and P₁(t) that come with one unit of visible P₂ and of P₃, for a wall that goes on by fractions of
/// the visible height.
fn lines(above: f64, below: f64) -> [[f64; 2]; 2] {
    let (e, length) = (above - below, 1.0 + above + below);
    let second = [1.5 * e * e + 0.5 - 0.5 * length * length, 3.0 * e];
    let third = [2.5 * e + 2.5 * e.powi(3) - 1.5 * length * length * e, 1.5 + 7.5 * e * e - 1.5 * length * length];
    [second, third]
}

/// Derivatives of the pose by a shift of the axis along x and y, and by a turn whose shift is −1 at the camera's height
/// and 1 at the reference.
fn moved(pose: &SiloPose, reference: f64) -> [[Vector4<f64>; 2]; 2] {
    let as_vector = |p: SiloPose| Vector4::new(p.r_x, p.r_y, p.t_x, p.t_y);
    let at = |offset: [f64; 2], slope: [f64; 2]| {
        let back = pose.rotation().transpose();
        let point = Vec3::new(offset[0] - pose.t_x, offset[1] - pose.t_y, 0.0);
        let axis = SiloPose::from_axis(&(back * Vec3::new(slope[0], slope[1], 1.0)), &(back * point));
        (as_vector(axis) - as_vector(*pose)) / STEP
    };
    let along = |axis: usize, value: f64| if axis == 0 { [value, 0.0] } else { [0.0, value] };
    [
        std::array::from_fn(|axis| at(along(axis, STEP), [0.0; 2])),
        std::array::from_fn(|axis| at(along(axis, -STEP), along(axis, 2.0 * STEP / reference))),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn legendre(degree: usize, t: f64) -> f64 {
        [1.0, t, 1.5 * t * t - 0.5, 2.5 * t.powi(3) - 1.5 * t][degree]
    }

    /// Coefficient of P_k over −1 to 1, by the midpoint rule.
    fn coefficient(k: usize, f: impl Fn(f64) -> f64) -> f64 {
        const N: usize = 20_000;
        let t = |i: usize| (2 * i + 1) as f64 / N as f64 - 1.0;
        (2 * k + 1) as f64 / N as f64 * (0..N).map(|i| f(t(i)) * legendre(k, t(i))).sum::<f64>()
    }

    #[test]
    fn columns_are_those_of_rings_and_bend() {
        use crate::geometry::surface::Part;
        use crate::surface_fit::joint::form::terms;
        let terms = terms(Part::Cylinder);
        assert!(terms[..RINGS].iter().enumerate().all(|(i, t)| (t.order, t.degree) == (0, i + 1)));
        let bend: Vec<_> = BEND.iter().map(|&i| (terms[i].order, terms[i].degree, terms[i].sine)).collect();
        assert_eq!(bend, [(1, 2, false), (1, 2, true), (1, 3, false), (1, 3, true)]);
    }

    #[test]
    fn a_longer_walls_bend_holds_a_line_of_the_visible_part() {
        for (above, below) in [(0.1, 0.0), (-0.1, 0.0), (0.1, 0.5), (-0.1, 1.0)] {
            for degree in [2, 3] {
                // over the whole wall, u is −1 at its upper and 1 at its lower end
                let whole = |t: f64| legendre(degree, (t + above - below) / (1.0 + above + below));
                let visible = coefficient(degree, whole);
                let [p0, p1] = lines(above, below)[degree - 2];
                assert!((coefficient(0, whole) / visible - p0).abs() < 1e-6, "{above} {below} {degree}");
                assert!((coefficient(1, whole) / visible - p1).abs() < 1e-6, "{above} {below} {degree}");
            }
        }
    }

    #[test]
    fn an_axis_that_turns_stays_at_the_middle() {
        let pose = SiloPose { r_x: 0.2, r_y: -0.3, t_x: 0.4, t_y: -0.2 };
        let [shift, turn] = moved(&pose, 4.0);
        let middle = Vec3::new(0.0, 0.0, 2.0);
        for (axis, (shift, turn)) in shift.iter().zip(&turn).enumerate() {
            let of = |d: &Vector4<f64>, size: f64| SiloPose {
                r_x: pose.r_x + size * d[0],
                r_y: pose.r_y + size * d[1],
                t_x: pose.t_x + size * d[2],
                t_y: pose.t_y + size * d[3],
            };
            // a point of the old axis in the camera frame, seen from the moved silo
            let camera = pose.rotation().transpose() * (middle - Vec3::new(pose.t_x, pose.t_y, 0.0));
            let shifted = of(shift, 1e-3).to_silo(&camera);
            assert!((shifted[axis] + 1e-3).abs() < 1e-6, "{shifted}");
            let turned = of(turn, 1e-3).to_silo(&camera);
            assert!(turned.x.abs() < 1e-5 && turned.y.abs() < 1e-5, "{turned}");
        }
    }
}
