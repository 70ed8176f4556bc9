//! The step of the camera between two groups of frames, all else being the same silo and camera.
//!
//! Both share radius, form, cone, intrinsics, bias and the priors on them: only the pose, and the cone's intercept, which
//! is counted from the camera's height, may differ. So what all frames have in common does not blur the comparison.

use crate::surface_fit::joint::parameters::{INTERCEPT, SIZE};
use crate::surface_fit::joint::system::{Prior, Quadratic};
use nalgebra::{DMatrix, DVector, Matrix4, Vector4};

/// Parameters that a move changes.
pub const MOVING: [usize; 5] = [0, 1, 2, 3, INTERCEPT];
/// How far a camera may have moved: radians, metres, and its height.
const STEPS: [f64; 5] = [0.3, 0.3, 0.5, 0.5, 0.5];

/// A step of the camera and its squared distance from none.
#[derive(Debug, Clone)]
pub struct Contrast {
    /// The step of all parameters that both sides share, with the pose and intercept before.
    pub common: [f64; SIZE],
    /// The step of r_x, r_y, t_x, t_y and the intercept.
    pub step: [f64; 5],
    /// Squared distance of the pose's whole step from none, for 4 degrees of freedom.
    pub squared: f64,
}

/// The step from one sum to another, beyond the step between the states about which they are; the first is about `at`.
/// `None` where the equations don't hold.
pub fn contrast(
    [before, after]: [&Quadratic; 2],
    (at, so_far): (&[f64; SIZE], &[f64; 5]),
    prior: &Prior,
) -> Option<Contrast> {
    let n = SIZE + MOVING.len();
    let std = |k: usize| if k < SIZE { prior.std[k] } else { STEPS[k - SIZE] };
    let source = |k: usize| if k < SIZE { k } else { MOVING[k - SIZE] };
    let free: Vec<usize> = (0..n).filter(|&k| std(k) > 0.0).collect();
    let value = |r: usize, c: usize| {
        let both = after.information[(source(r), source(c))];
        if r < SIZE && c < SIZE { before.information[(r, c)] + both } else { both }
    };
    let m = free.len();
    let system = DMatrix::from_fn(m, m, |r, c| {
        let (a, b) = (free[r], free[c]);
        value(a, b) * std(a) * std(b) + if r == c { 1.0 } else { 0.0 }
    });
    let pull = DVector::from_fn(m, |r, _| {
        let k = free[r];
        let gradient = after.gradient[source(k)] + if k < SIZE { before.gradient[k] } else { 0.0 };
        let off = if k < SIZE { (at[k] - prior.mean[k]) / std(k) } else { so_far[k - SIZE] / std(k) };
        -gradient * std(k) - off
    });
    let factor = nalgebra::Cholesky::new(system)?;
    let solution = factor.solve(&pull);
    let place = |k: usize| free.iter().position(|&f| f == SIZE + k);
    let places: Vec<usize> = (0..4).filter_map(place).collect();
    let unit = DMatrix::from_fn(m, 4, |r, c| if places.get(c) == Some(&r) { 1.0 } else { 0.0 });
    let columns = factor.solve(&unit);
    let mut full = vec![0.0; n];
    free.iter().enumerate().for_each(|(r, &k)| full[k] = solution[r] * std(k));
    let step = std::array::from_fn(|k| full[SIZE + k]);
    let pose = Vector4::from_fn(|k, _| so_far[k] + full[SIZE + k]);
    let covariance = Matrix4::from_fn(|r, c| columns[(places[r], c)] * STEPS[r] * STEPS[c]);
    let squared = pose.dot(&covariance.cholesky()?.solve(&pose));
    Some(Contrast { common: std::array::from_fn(|k| full[k]), step, squared })
}
