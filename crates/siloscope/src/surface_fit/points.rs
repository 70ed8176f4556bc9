//! The last solution of a wall's tiles of points: the answer with its covariance.

use crate::SiloPose;
use crate::Vec3;
use crate::base::refusal::Refusal;
use crate::geometry::evaluator::SurfaceEvaluator;
use crate::geometry::parameters::{BIAS, PARAMETERS, Parameters};
use crate::surface_fit::common::lasting_misfit;
use crate::surface_fit::covariance::{form_uncertainty, widened};
use crate::surface_fit::diagnostics::WallEvidence;
use crate::surface_fit::equation::TileEquation;
use crate::surface_fit::factor::frame_factor;
use crate::surface_fit::frame_factor::restrict;
use crate::surface_fit::joint::model::Inputs;
use crate::surface_fit::misfit::{misfit_of, misfit_to_start_from};
use crate::surface_fit::outcome::{Outcome, SurfaceFit, check_determined};
use crate::surface_fit::solver::{Fit, Prior, Problem, System, free_parameters, tukey, tukey_slope};
use crate::surface_fit::tiles::Patches;
use crate::surface_fit::warm_start::KnownWall;

/// How far a wall lies off its mean over a block of tiles, as a multiple of the misfit that the tiles show: stuck feed and
/// dents move neighbouring tiles alike.
const MISFIT_FORM: f64 = 2.0;
/// Misfit that chance alone shows on a smooth wall, metres.
const CHANCE_MISFIT: f64 = 2e-4;

/// Last solution, covariance and residuals.
pub fn finish(
    problem: &Problem,
    mut fit: Fit,
    tiles: &mut [TileEquation],
    (evidence, wall): (WallEvidence, KnownWall),
) -> Outcome {
    let system = solve_equations(problem, &mut fit, tiles, 4).ok_or(Refusal::PoorlyDetermined)?;
    let pulls: Vec<f64> = tiles.iter().map(TileEquation::pull).collect();
    let free = free_parameters(&fit, &system.prior);
    let model = system.covariance(&fit).ok_or(Refusal::PoorlyDetermined)?;
    let mut covariance = widened(problem, &model, &system, (tiles, &pulls));
    let lasting = lasting_misfit(problem.patches, fit.misfit, tiles);
    covariance += form_uncertainty(&system, &fit, tiles, MISFIT_FORM * (lasting - CHANCE_MISFIT).max(0.0));
    let heights = tiles.iter().map(|t| t.equation.z).sum::<f64>();
    let placed = SurfaceEvaluator::new(fit.surface);
    check_determined(&covariance, &placed, heights / tiles.len().max(1) as f64)?;
    let factor = frame_factor(&fit, (&system, &covariance), (tiles, &pulls), &free, inputs(problem.prior, &free));
    let (residuals, chi_square) = residuals(tiles, problem.patches.list.len());
    Ok(SurfaceFit {
        covariance: restrict(&covariance, &free),
        factor,
        free,
        noise: problem.noise,
        chi_square,
        evidence,
        wall,
        patches: Patches::default(),
        residuals,
        fit,
        timing: Vec::new(),
        joint: None,
    })
}

/// What was known before, as the joint fit has it; the bias where it is estimated.
fn inputs(prior: &Prior, free: &[bool; PARAMETERS]) -> Inputs {
    Inputs {
        bias: prior.bias,
        bias_std: std::array::from_fn(|k| if free[BIAS.start + k] { prior.bias_std[k] } else { 0.0 }),
        radius: prior.radius,
        gravity: prior.gravity.map(|(down, std)| (SiloPose::from_axis(&down, &Vec3::zeros()), std)),
        camera_std: [0.0; 5],
    }
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
fn solve_equations(problem: &Problem, fit: &mut Fit, equations: &mut [TileEquation], rounds: usize) -> Option<System> {
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

/// Residual of each of n patches across the wall, NaN where it does not count, and their reduced chi-square.
fn residuals(tiles: &[TileEquation], n: usize) -> (Vec<f64>, f64) {
    let mut residuals = vec![f64::NAN; n];
    let (mut chi, mut weights) = (0.0, 0.0);
    for TileEquation { patch, equation: e, .. } in tiles {
        let squared = e.residual * e.residual / e.variance;
        let weight = tukey(squared);
        if weight > 0.0 {
            residuals[*patch] = e.residual * e.cosine;
        }
        chi += weight * squared;
        weights += weight;
    }
    (residuals, chi / f64::max(weights, 1.0))
}
