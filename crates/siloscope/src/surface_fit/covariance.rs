//! How sure the fit is: the noise's covariance, widened by what the residuals say about the model, and the scale.

use crate::geometry::parameters::{Information, OVALITY, PARAMETERS, Parameters};
use crate::surface_fit::common::variance_of_neighbours;
use crate::surface_fit::polish::TileEquation;
use crate::surface_fit::solver::{Equation, Fit, Problem, System, tukey, tukey_slope};
use crate::surface_fit::tiles::DEEPEST;
use nalgebra::{Matrix4, Vector4};

/// The model's covariance, widened in those directions in which groups of tiles disagree more than it says.
///
/// Residuals that are correlated over many tiles (dents, corrugation, a warped lens) don't average out as noise does.
/// The sum over groups of the outer product of their gradients estimates what they really do to the parameters. Groups
/// are single tiles (noise that the law does not know of), blocks of the image, rings of equal height (corrugation, seams)
/// and sectors (upright seams, ovality).
pub fn widened(
    problem: &Problem,
    model: &Information,
    system: &System,
    (tiles, pulls): (&[TileEquation], &[f64]),
) -> Information {
    let size = tiles.iter().map(|t| t.equation.z.abs()).fold(0.0, f64::max).max(1e-6);
    let ring = |t: &TileEquation| ((t.equation.z / size + 1.0) * RINGS).max(0.0) as usize;
    let sector = |t: &TileEquation| {
        let [x, y] = t.equation.across;
        ((y.atan2(x) / std::f64::consts::TAU + 0.5) * SECTORS).max(0.0) as usize
    };
    let groups =
        [groups(tiles, pulls, |t| block(problem, t.patch)), groups(tiles, pulls, ring), groups(tiles, pulls, sector)];
    let sandwich = |spread: System| {
        let mut spread = spread.information + system.prior;
        spread.fill_upper_triangle_with_lower_triangle();
        model * spread * model
    };
    let (mut alone, together) = (System::empty(), flatter(tiles) * variance_of_neighbours(problem.patches, tiles));
    tiles.iter().zip(pulls).for_each(|(t, pull)| alone.add_row(&t.equation.jacobian, 0.0, pull * pull * together));
    groups.iter().fold(larger(model, &sandwich(alone)), |covariance, groups| {
        let mut spread = System::empty();
        groups.iter().for_each(|g| spread.add_row(g, 0.0, 1.0));
        larger(&covariance, &(sandwich(spread) * chance(groups.len())))
    })
}

/// By how much larger the variance is because large residuals count less: the square of the weights over the slopes.
fn flatter(tiles: &[TileEquation]) -> f64 {
    let squared = tiles.iter().map(|t| t.equation.residual.powi(2) / t.equation.variance);
    let (weights, slopes) = squared.fold((0.0, 0.0), |(w, s), squared| (w + tukey(squared), s + tukey_slope(squared)));
    if slopes > 0.0 { f64::powi(weights / slopes, 2).clamp(1.0, MOST_FLATTER) } else { MOST_FLATTER }
}

/// Most that counting large residuals less makes of a variance.
const MOST_FLATTER: f64 = 4.0;
/// Rings of equal height over the wall's depth.
const RINGS: f64 = 160.0;
/// Sectors around the axis.
const SECTORS: f64 = 48.0;
/// Side of a block in tiles.
const BLOCK: u32 = 8;

fn block(problem: &Problem, patch: usize) -> usize {
    let (column, row) = problem.patches.list[patch].tile;
    (row / BLOCK) as usize * problem.patches.columns + (column / BLOCK) as usize
}

/// Gradients of the groups.
fn groups(tiles: &[TileEquation], pulls: &[f64], group: impl Fn(&TileEquation) -> usize) -> Vec<Parameters> {
    let mut sums: Vec<Option<Parameters>> = Vec::new();
    for (tile, pull) in tiles.iter().zip(pulls) {
        let group = group(tile);
        if group >= sums.len() {
            sums.resize(group + 1, None);
        }
        *sums[group].get_or_insert_with(Parameters::zeros) += tile.equation.jacobian * *pull;
    }
    sums.into_iter().flatten().collect()
}

/// Undoes what chance alone makes of the largest eigenvalue of a covariance from n samples (Marchenko and Pastur).
fn chance(samples: usize) -> f64 {
    const FREE: f64 = 7.0;
    (1.0 + (FREE / samples.max(1) as f64).sqrt()).powi(-2)
}

/// The share of the wall's relief (corrugation, rust) in the covariance, and of its `form` beside that, metres.
///
/// Within a tile the pixels scatter by the sensor's noise and by the wall's relief across it. A grazing ray meets the
/// relief's crests and not its troughs, so the mean wall is seen shifted inwards. That shift follows the incidence over
/// the whole frame, and beside that each block of tiles sees its own part of the pattern: neither averages out as noise.
pub fn relief_uncertainty(
    joint: &System,
    fit: &Fit,
    tiles: &[TileEquation],
    (relief, form): (f64, f64),
) -> Information {
    if relief.max(form) == 0.0 {
        return Information::zeros();
    }
    let (mut pull, mut system) = (Parameters::zeros(), joint.prior_alone());
    for TileEquation { equation: e, spread, .. } in tiles {
        let weight = tukey(e.residual * e.residual / e.variance);
        let along = (RELIEF_SHARE * relief / e.cosine).hypot(form * spread);
        let blocked = Equation { variance: along * along * f64::from(BLOCK * BLOCK), ..*e };
        system.add(&blocked, weight);
        pull += e.jacobian * (relief * (1.0 - e.cosine) / e.cosine * weight / blocked.variance);
    }
    system
        .covariance(fit)
        .map_or(Information::zeros(), |(spread, _)| spread + spread * pull * (spread * pull).transpose())
}

/// Whether the residuals show that the silo is oval: the two parts of its ovality against their covariance.
pub fn shows_ovality(problem: &Problem, fit: &Fit, tiles: &mut [TileEquation], std: f64) -> bool {
    let mut system = System::with_prior(problem.prior, fit).with_ovality(std);
    for tile in tiles {
        tile.allow(fit.misfit);
        let e = &tile.equation;
        system.add(e, tukey(e.residual * e.residual / e.variance));
    }
    let (Some(step), Some((covariance, _))) = (system.solve(fit), system.covariance(fit)) else { return false };
    let (found, spread) = (step.fixed_rows::<2>(OVALITY), covariance.fixed_view::<2, 2>(OVALITY, OVALITY));
    let squared = spread.try_inverse().map_or(0.0, |inverse| found.dot(&(inverse * found)));
    squared > SURE
}

/// Chi-square of two degrees of freedom that chance passes once in 20,000 frames.
const SURE: f64 = 20.0;

/// How far a block's mean lies off by the relief, as a share of it.
const RELIEF_SHARE: f64 = 0.3;

/// Root-mean-square relief across the wall, metres; 0 where the pixels' scatter needs none beside the noise.
pub fn relief(tiles: &[TileEquation]) -> f64 {
    let (mut weights, mut sum) = (0.0, 0.0);
    for TileEquation { equation: e, expected, scatter, count, .. } in tiles {
        let across = e.cosine * e.cosine;
        let noise = expected * across;
        let weight = count / (2.0 * noise * noise).max(1e-24); // of an estimated variance
        weights += weight;
        sum += weight * (scatter * scatter * across - noise);
    }
    let (excess, error) = (sum / weights, weights.powf(-0.5));
    if excess > 5.0 * error + RESOLUTION * RESOLUTION { excess.sqrt().min(DEEPEST) } else { 0.0 }
}

/// The same where the noise itself has to be told from the scatter: relief grows with the incidence, noise with the depth.
///
/// Least squares of the tiles' variances on 1, d² and d⁴ for the noise and 1/cos² for the relief. Where depth and incidence
/// go together they can't be told apart, and the relief is 0.
pub fn relief_beside_noise(tiles: &[TileEquation]) -> f64 {
    let (mut normal, mut right) = (Matrix4::zeros(), Vector4::zeros());
    let rows = tiles.iter().map(|TileEquation { equation: e, noise, scatter, count, .. }| {
        let (d2, single) = (e.jacobian[8] * e.jacobian[8], noise * count);
        let weight = count / (2.0 * single * single).max(1e-24); // of an estimated variance
        (Vector4::new(1.0, d2, d2 * d2, 1.0 / (e.cosine * e.cosine)), scatter * scatter, weight)
    });
    for (row, variance, weight) in rows.clone() {
        normal += row * row.transpose() * weight;
        right += row * (variance * weight);
    }
    let Some(inverse) = normal.try_inverse() else { return 0.0 };
    let law = inverse * right;
    let misfit: f64 = rows.map(|(row, variance, weight)| weight * (variance - row.dot(&law)).powi(2)).sum();
    let error = (inverse[(3, 3)] * (misfit / tiles.len() as f64).max(1.0)).sqrt();
    if law[3] > 5.0 * error + RESOLUTION * RESOLUTION { law[3].sqrt().min(DEEPEST) } else { 0.0 }
}

/// Relief that rounding of raw depths feigns, metres.
const RESOLUTION: f64 = 3e-4;

/// The share of an unknown depth scale in the covariance: every length of the answer goes with it.
pub fn scale_uncertainty(fit: &Fit, std: f64) -> Information {
    let pose = &fit.surface.pose;
    let intercept = fit.surface.cone.map_or(0.0, |c| c.intercept());
    let mut lengths = Parameters::zeros();
    for (k, length) in [(2, pose.t_x), (3, pose.t_y), (4, fit.surface.radius.unwrap_or(0.0)), (6, intercept)] {
        lengths[k] = length * std;
    }
    lengths * lengths.transpose()
}

/// The smallest covariance that is at least as large as `a` in every direction and as `b` where that is larger.
fn larger(a: &Information, b: &Information) -> Information {
    let scale = a.diagonal().map(|v| if v > 0.0 { v.sqrt() } else { 1.0 });
    let scaled = |m: &Information| m.map_with_location(|r, c, v| v / (scale[r] * scale[c]));
    let mut own = scaled(a);
    for k in 0..PARAMETERS {
        own[(k, k)] += if a[(k, k)] > 0.0 { 1e-13 } else { 1.0 }; // what is not estimated stays apart
    }
    let Some(root) = own.cholesky().map(|c| c.l()) else { return a + b };
    let Some(half) = root.solve_lower_triangular(&scaled(b)) else { return a + b };
    let Some(relative) = root.solve_lower_triangular(&half.transpose()) else { return a + b };
    let eigen = ((relative + relative.transpose()) * 0.5).symmetric_eigen();
    let excess = Information::from_diagonal(&eigen.eigenvalues.map(|v| (v - 1.0).max(0.0)));
    let turned = root * eigen.eigenvectors;
    let more = turned * excess * turned.transpose();
    a + more.map_with_location(|r, c, v| v * scale[r] * scale[c])
}
