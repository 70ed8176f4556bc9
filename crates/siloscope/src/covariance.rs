//! How sure the fit is: the noise's covariance, widened by what the residuals say about the model, and the scale.

use crate::polish::TileEquation;
use crate::refine::{Equation, Fit, Problem, System, tukey};
use crate::surface::{Information, Parameters};

/// The model's covariance, widened in those directions in which groups of tiles disagree more than it says.
///
/// Residuals that are correlated over many tiles (dents, corrugation, a warped lens) don't average out as noise does.
/// The sum over groups of the outer product of their gradients estimates what they really do to the parameters. Groups
/// are blocks of the image, rings of equal height (corrugation, seams) and sectors (upright seams, ovality).
pub fn widened(
    problem: &Problem,
    model: &Information,
    system: &System,
    equations: &[(usize, Equation)],
) -> Information {
    let blocks = groups(equations, |i, _| block(problem, i));
    let size = equations.iter().map(|(_, e)| e.z.abs()).fold(0.0, f64::max).max(1e-6);
    let rings = groups(equations, |_, e| (e.z / size * RINGS).floor() as i64);
    let sectors =
        groups(equations, |_, e| (e.across[1].atan2(e.across[0]) / std::f64::consts::TAU * SECTORS).floor() as i64);
    [blocks, rings, sectors].iter().fold(*model, |covariance, groups| {
        let spread = groups.iter().fold(system.prior, |sum, g| sum + g * g.transpose());
        larger(&covariance, &(model * spread * model * chance(groups.len())))
    })
}

/// Rings of equal height over the wall's depth.
const RINGS: f64 = 160.0;
/// Sectors around the axis.
const SECTORS: f64 = 48.0;
/// Side of a block in tiles.
const BLOCK: u32 = 8;

fn block(problem: &Problem, patch: usize) -> i64 {
    if problem.patches.cloud {
        return (patch / 16) as i64;
    }
    let (column, row) = problem.patches.list[patch].tile;
    i64::from(row / BLOCK) * 1_000_000 + i64::from(column / BLOCK)
}

/// Gradients of the groups.
fn groups(equations: &[(usize, Equation)], key: impl Fn(usize, &Equation) -> i64) -> Vec<Parameters> {
    let mut sums: std::collections::BTreeMap<i64, Parameters> = std::collections::BTreeMap::new();
    for (i, e) in equations {
        let weight = tukey(e.residual * e.residual / e.variance);
        *sums.entry(key(*i, e)).or_insert_with(Parameters::zeros) += e.jacobian * (weight * e.residual / e.variance);
    }
    sums.into_values().collect()
}

/// Undoes what chance alone makes of the largest eigenvalue of a covariance from n samples (Marchenko and Pastur).
fn chance(samples: usize) -> f64 {
    const FREE: f64 = 7.0;
    (1.0 + (FREE / samples.max(1) as f64).sqrt()).powi(-2)
}

/// The share of the wall's relief (corrugation, rust) in the covariance.
///
/// Within a tile the pixels scatter by the sensor's noise and by the wall's relief across it. A grazing ray meets the
/// relief's crests and not its troughs, so the mean wall is seen shifted inwards. That shift follows the incidence over
/// the whole frame, and beside that each block of tiles sees its own part of the pattern: neither averages out as noise.
pub fn relief_uncertainty(
    problem: &Problem,
    fit: &Fit,
    tiles: &[TileEquation],
    moved: &[(usize, Equation)],
) -> Information {
    let relief = relief(tiles);
    if relief == 0.0 {
        return Information::zeros();
    }
    let (mut pull, mut system) = (Parameters::zeros(), System::with_prior(problem.prior, fit));
    for (_, e) in moved {
        let weight = tukey(e.residual * e.residual / e.variance);
        let across = RELIEF_SHARE * relief / e.cosine;
        let blocked = Equation { variance: across * across * f64::from(BLOCK * BLOCK), ..*e };
        system.add(&blocked, weight);
        pull += e.jacobian * (relief * (1.0 - e.cosine) / e.cosine * weight / blocked.variance);
    }
    system
        .covariance(fit)
        .map_or(Information::zeros(), |(spread, _)| spread + spread * pull * (spread * pull).transpose())
}

/// How far a block's mean lies off by the relief, as a share of it.
const RELIEF_SHARE: f64 = 0.3;

/// Root-mean-square relief across the wall, metres; 0 where the pixels' scatter needs none beside the noise.
fn relief(tiles: &[TileEquation]) -> f64 {
    let (mut weights, mut sum) = (0.0, 0.0);
    for TileEquation { equation: e, scatter, count, .. } in tiles {
        let across = e.cosine * e.cosine;
        let noise = e.variance * count * across;
        let weight = count / (2.0 * noise * noise).max(1e-24); // of an estimated variance
        weights += weight;
        sum += weight * (scatter * scatter * across - noise);
    }
    let (excess, error) = (sum / weights, weights.powf(-0.5));
    if excess > 5.0 * error + RESOLUTION * RESOLUTION { excess.sqrt() } else { 0.0 }
}

/// Relief that rounding of raw depths feigns, metres.
const RESOLUTION: f64 = 3e-4;

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
