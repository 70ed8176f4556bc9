//! How sure the fit is: the noise's covariance, widened by what the residuals say about the model, and the scale.

use crate::refine::{Equation, Fit, Problem, System, tukey};
use crate::surface::{Information, Parameters};

/// The model's covariance, widened in those directions in which blocks of tiles disagree more than it says.
///
/// Residuals that are correlated over many tiles (dents, corrugation, a warped lens) don't average out as noise does.
/// The sum over blocks of the outer product of their gradients estimates what they really do to the parameters.
pub fn widened(
    problem: &Problem,
    model: &Information,
    system: &System,
    equations: &[(usize, Equation)],
) -> Information {
    const BLOCK: u32 = 8;
    let mut blocks: std::collections::BTreeMap<(u32, u32), Parameters> = std::collections::BTreeMap::new();
    for (i, e) in equations {
        let (column, row) = problem.patches.list[*i].tile;
        let key = if problem.patches.cloud { (*i as u32 / 16, 0) } else { (column / BLOCK, row / BLOCK) };
        let weight = tukey(e.residual * e.residual / e.variance);
        *blocks.entry(key).or_insert_with(Parameters::zeros) += e.jacobian * (weight * e.residual / e.variance);
    }
    let mut gradients = system.prior;
    for g in blocks.values() {
        gradients += g * g.transpose();
    }
    larger(model, &(model * gradients * model))
}

/// The share of an unknown depth scale in the covariance: every length of the answer goes with it.
pub fn scale_uncertainty(fit: &Fit, std: f64) -> Information {
    let pose = &fit.surface.pose;
    let apex = fit.surface.cone.map_or(0.0, |c| c.apex);
    let mut lengths = Parameters::zeros();
    for (k, length) in [(2, pose.t_x), (3, pose.t_y), (4, fit.surface.radius.unwrap_or(0.0)), (6, apex)] {
        lengths[k] = length * std;
    }
    lengths * lengths.transpose()
}

/// The smallest covariance that is at least as large as `a` in every direction and as `b` where that is larger.
fn larger(a: &Information, b: &Information) -> Information {
    let scale = a.diagonal().map(|v| if v > 0.0 { v.sqrt() } else { 1.0 });
    let scaled = |m: &Information| m.map_with_location(|r, c, v| v / (scale[r] * scale[c]));
    let eigen = scaled(a).symmetric_eigen();
    let root = |f: fn(f64) -> f64| {
        let d = eigen.eigenvalues.map(|v| if v > 1e-13 { f(v) } else { 0.0 });
        eigen.eigenvectors * Information::from_diagonal(&d) * eigen.eigenvectors.transpose()
    };
    let (half, inverse) = (root(f64::sqrt), root(|v| 1.0 / v.sqrt()));
    let relative = inverse * scaled(b) * inverse;
    let relative = ((relative + relative.transpose()) * 0.5).symmetric_eigen();
    let excess = Information::from_diagonal(&relative.eigenvalues.map(|v| v.max(1.0)));
    let turned = half * relative.eigenvectors;
    let joined = turned * excess * turned.transpose();
    joined.map_with_location(|r, c, v| v * scale[r] * scale[c])
}
