//! The last steps of the fit: residuals of pixels, not tiles, against the exact wall.

use crate::geometry::depth_image::DepthImage;
use crate::geometry::evaluator::SurfaceEvaluator;
use crate::geometry::parameters::Parameters;
use crate::geometry::sensor::NoiseLaw;
pub use crate::surface_fit::equation::TileEquation;
use crate::surface_fit::misfit::{misfit_of, misfit_to_start_from, spread_misfit};
use crate::surface_fit::residual::{Sampling, tile_residual};
use crate::surface_fit::solver::{Equation, Fit, Problem, System, tukey, tukey_slope};
use crate::surface_fit::tiles::{Patch, noise_from_scatter};

/// One Gauss–Newton step on pixel residuals; returns the noise law, from the residuals themselves where none is known.
pub fn polish(
    problem: &Problem,
    image: &DepthImage,
    fit: &mut Fit,
    wall: &[bool],
    reach: f64,
    known: Option<NoiseLaw>,
) -> NoiseLaw {
    let mut equations = pixel_equations(problem, image, fit, wall, &Thinning { reach, ..SKETCH });
    let noise = known.unwrap_or_else(|| {
        let sample = |e: &TileEquation| (problem.patches.list[e.patch].measured, e.scatter);
        noise_from_scatter(&mut equations.iter().map(sample).collect::<Vec<_>>(), 1e-5)
    });
    solve_equations(problem, fit, &mut equations, 2);
    noise
}

/// Which pixels of the wall are asked.
#[derive(Debug, Clone, Copy)]
pub struct Thinning {
    /// Every so many tiles.
    pub tiles: usize,
    /// Every so many rows of a tile.
    pub stride: usize,
    /// Pixels further off than the noise and so many misfits allow don't count.
    pub reach: f64,
}

/// Every pixel: the answer.
pub const ALL: Thinning = Thinning { tiles: 1, stride: 1, reach: 1.0 };

/// One pixel in twelve: the steps towards it.
const SKETCH: Thinning = Thinning { tiles: 3, stride: 4, reach: 3.0 };

/// Equations of the wall's tiles from their pixels.
pub fn pixel_equations(
    problem: &Problem,
    image: &DepthImage,
    fit: &Fit,
    wall: &[bool],
    thinning: &Thinning,
) -> Vec<TileEquation> {
    let Thinning { tiles, stride, reach } = *thinning;
    let placed = SurfaceEvaluator::new(fit.surface);
    let tile = |patch: usize| {
        let (d, _) = placed.depth(&problem.patches.list[patch].q);
        let equation = problem.equation_at(fit, &placed, patch, d)?;
        let Patch { count, scatter, .. } = problem.patches.list[patch];
        let misfit = fit.misfit / equation.cosine;
        let expected = (equation.variance - misfit * misfit).max(0.0) * count;
        let single = noisier(expected, scatter);
        let sampling = Sampling { stride, reach: 4.0 * (single.sqrt() + reach * misfit) };
        let seen = tile_residual(image, problem.patches, (patch, equation.part), &placed, &fit.bias, sampling);
        let enough = seen.count * stride as f64 >= 0.5 * count;
        let noise = single / seen.count;
        let equation = Equation { residual: seen.mean, variance: noise, ..equation };
        let spread = 1.0 / equation.cosine; // until all are there
        enough.then_some(TileEquation {
            patch,
            equation,
            noise,
            expected,
            scatter: seen.scatter,
            count: seen.count,
            spread,
        })
    };
    let mut equations = Vec::with_capacity(wall.len() / tiles);
    equations.extend((0..wall.len()).filter(|&i| wall[i]).step_by(tiles).filter_map(tile));
    spread_misfit(&mut equations);
    equations
}

/// Variance of a tile's pixels: the expected one, or their own where that is surely larger, as at grazing incidence.
fn noisier(expected: f64, scatter: f64) -> f64 {
    const SURELY: f64 = 1.5;
    let own = scatter * scatter;
    if own > SURELY * expected { own } else { expected }
}

/// A step this small is the last, in squared standard deviations; the next would be a hundredth of it.
const SETTLED: f64 = 0.01;
/// The misfit has settled where it changes by no more than this share of it.
const SAME_MISFIT: f64 = 0.01;

/// Most that a step is made longer by.
const LONGER: f64 = 1.4;

/// Robust solution of linear equations: reweighted a few times, the misfit re-estimated on the way.
///
/// Leaves the equations as they are after the step, with the misfit in their variance.
pub fn solve_equations(
    problem: &Problem,
    fit: &mut Fit,
    equations: &mut [TileEquation],
    rounds: usize,
) -> Option<System> {
    let mut total = Parameters::zeros();
    let mut system = System::with_prior(problem.prior, fit);
    let start = misfit_to_start_from(fit, equations);
    equations.iter_mut().for_each(|e| e.allow(start));
    for _ in 0..rounds {
        system = System::with_prior(problem.prior, fit);
        let (mut weights, mut slopes) = (0.0, 0.0);
        for TileEquation { equation: e, .. } in equations.iter() {
            let squared = e.residual * e.residual / e.variance;
            let weight = tukey(squared);
            system.add(e, weight);
            weights += weight;
            slopes += tukey_slope(squared);
        }
        // the residuals are already moved by `total`, the prior is not
        system.gradient += system.prior * total;
        // with weights in place of slopes the step falls short by their ratio
        let step = system.solve(fit)? * (weights / slopes).clamp(1.0, LONGER);
        total += step;
        equations.iter_mut().for_each(|e| e.equation.residual += e.equation.jacobian.dot(&step));
        let before = fit.misfit;
        fit.misfit = misfit_of(equations);
        equations.iter_mut().for_each(|e| e.allow(fit.misfit));
        if -system.gradient.dot(&step) < SETTLED && (fit.misfit / before - 1.0).abs() < SAME_MISFIT {
            break;
        }
    }
    fit.surface = fit.surface.stepped(&total);
    fit.bias = fit.bias.stepped(&total);
    Some(system)
}
