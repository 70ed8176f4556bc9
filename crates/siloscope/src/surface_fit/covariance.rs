//! How sure a fit to points is: the noise's covariance, widened by what the residuals say about the model.

use crate::geometry::parameters::{Information, PARAMETERS, Parameters};
use crate::surface_fit::common::variance_of_neighbours;
use crate::surface_fit::equation::TileEquation;
use crate::surface_fit::solver::{Equation, Fit, Problem, System, tukey, tukey_slope};

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

/// What a wall's `form`, by which it lies off its mean over a block of tiles, metres, does to the answer.
pub fn form_uncertainty(system: &System, fit: &Fit, tiles: &[TileEquation], form: f64) -> Information {
    if form == 0.0 {
        return Information::zeros();
    }
    let mut blocked = system.prior_alone();
    for TileEquation { equation: e, spread, .. } in tiles {
        let along = form * spread;
        let variance = along * along * f64::from(BLOCK * BLOCK);
        blocked.add(&Equation { variance, ..*e }, tukey(e.residual * e.residual / e.variance));
    }
    blocked.covariance(fit).unwrap_or_else(Information::zeros)
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
