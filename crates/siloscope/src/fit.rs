//! The surface fit: a depth frame in, the silo's wall as cylinder and cone out, with its covariance.

use crate::Vec3;
use crate::patches::{DepthImage, NONE, Patches, noise_from_scatter, tile_patches};
use crate::pixels::tile_residual;
use crate::refine::{Equation, Fit, Prior, Problem, System, tukey};
use crate::sensor::{DepthBias, DepthError, NoiseLaw};
use crate::start::{Oriented, Start, other_part, starts};
use crate::surface::{Information, PARAMETERS, Parameters, PlacedSurface, SiloSurface};
use crate::verdict::{WallEvidence, wall_evidence};

/// What the caller knows.
#[derive(Debug, Clone)]
pub struct Knowledge {
    /// The sensor's depth error.
    pub error: DepthError,
    /// Radius of the cylinder and its standard deviation, metres.
    pub radius: Option<(f64, f64)>,
    /// Direction of gravity in the camera frame and its standard deviation, radians.
    pub gravity: Option<(Vec3, f64)>,
}

/// Result of the fit, before it is judged.
#[derive(Debug, Clone)]
pub struct SurfaceFit {
    /// State: surface, bias, misfit.
    pub fit: Fit,
    /// Covariance over all parameters; zero rows for those that are not free.
    pub covariance: Information,
    /// Information that this frame alone adds, without priors (for fusing frames).
    pub information: Information,
    /// Which parameters are estimated.
    pub free: [bool; PARAMETERS],
    /// Noise law used.
    pub noise: NoiseLaw,
    /// Residual scatter over expectation (reduced chi-square) of the tiles.
    pub chi_square: f64,
    /// What the wall looks like.
    pub evidence: WallEvidence,
    /// The patches, and which of them are wall.
    pub patches: Patches,
    /// Wall patches.
    pub wall: Vec<bool>,
    /// Final residual of each wall patch across the wall, metres; NaN elsewhere.
    pub residuals: Vec<f64>,
    /// Milliseconds of each stage, in order.
    pub timing: Vec<(&'static str, f64)>,
}

/// Fits the wall to a depth image; `None` where nothing of revolution is found.
pub fn fit_image(image: &DepthImage, know: &Knowledge) -> Option<SurfaceFit> {
    let mut clock = Clock::start();
    let patches = tile_patches(image, know.error.noise.as_ref());
    let noise = know.error.noise.unwrap_or_else(|| noise_of(&patches));
    let prior = prior(know);
    let problem = Problem { patches: &patches, noise, prior: &prior, pixel: pixel_size(image) };
    clock.lap("patches");
    let found = starts(&oriented(&problem, &prior.bias));
    clock.lap("starts");
    let mut fit = coarse_fit(&problem, found)?;
    if let (Some((radius, _)), true) = (know.radius, prior.bias_std[1] > 0.0) {
        fit.rescale_to(radius);
    }
    let wall = wall_patches(&problem, &fit);
    clock.lap("coarse fit");
    let noise = polish(&problem, image, &mut fit, &wall, (2, 3.0), know.error.noise);
    let problem = Problem { noise, ..problem };
    polish(&problem, image, &mut fit, &wall, (2, 2.0), Some(noise));
    let equations = pixel_equations(&problem, image, &fit, &wall, (1, 1.0));
    clock.lap("pixels");
    let mut result = finish(&problem, fit, wall, equations)?;
    clock.lap("covariance");
    result.timing = clock.laps;
    Some(result)
}

/// Milliseconds of the stages.
struct Clock {
    last: std::time::Instant,
    laps: Vec<(&'static str, f64)>,
}

impl Clock {
    fn start() -> Self {
        Self { last: std::time::Instant::now(), laps: Vec::new() }
    }

    fn lap(&mut self, name: &'static str) {
        let now = std::time::Instant::now();
        self.laps.push((name, (now - self.last).as_secs_f64() * 1e3));
        self.last = now;
    }
}

fn pixel_size(image: &DepthImage) -> f64 {
    let (first, last) = (image.rays[0], image.rays[image.width - 1]);
    (last[0] - first[0]).abs() / (image.width - 1).max(1) as f64
}

fn prior(know: &Knowledge) -> Prior {
    let mut bias_std = know.error.bias_std;
    if know.radius.is_some() && know.error.noise.is_none() {
        bias_std[1] = bias_std[1].max(0.05); // a known radius fixes the scale better than any expectation
    }
    Prior { bias: know.error.bias, bias_std, radius: know.radius, gravity: know.gravity }
}

fn noise_of(patches: &Patches) -> NoiseLaw {
    let mut samples: Vec<(f64, f64)> =
        patches.list.iter().filter(|p| p.smooth).map(|p| (p.measured, p.scatter)).collect();
    noise_from_scatter(&mut samples, 1e-4)
}

/// Refines each start value on a part of the patches, and the best on all.
///
/// The depth scale stays fixed here: it trades against the silo's size along a curve on which Gauss–Newton steps crawl.
/// A known radius then moves the answer along that curve exactly.
pub fn coarse_fit(problem: &Problem, found: Vec<Start>) -> Option<Fit> {
    let free_size =
        Prior { radius: problem.prior.radius.filter(|_| problem.prior.bias_std[1] == 0.0), ..problem.prior.clone() };
    let problem = &Problem { prior: &free_size, patches: problem.patches, noise: problem.noise, pixel: problem.pixel };
    let mut best: Option<(f64, Fit)> = None;
    for start in found.into_iter().take(5) {
        let mut fit = Fit {
            surface: start.surface,
            bias: problem.prior.bias,
            inside: start.inside,
            misfit: 0.03 * start.surface.radius.unwrap_or(1.0),
            weights: vec![0.0; problem.patches.list.len()],
        };
        problem.refine(&mut fit, 6, 4, 0.25);
        let score = likelihood(problem, &fit);
        if best.as_ref().is_none_or(|(top, _)| score > *top) {
            best = Some((score, fit));
        }
    }
    let (_, mut fit) = best?;
    problem.refine(&mut fit, 3, 2, 0.2);
    if fit.surface.cone.is_none() != fit.surface.radius.is_none() && fit.inside {
        fit = with_other_part(problem, fit);
    }
    problem.refine(&mut fit, 4, 1, 0.15);
    Some(fit)
}

/// Looks again for the part that is missing, now that the axis and the depth bias are known better.
fn with_other_part(problem: &Problem, fit: Fit) -> Fit {
    let before = likelihood(problem, &fit);
    let Some(surface) = other_part(&fit.surface, &oriented(problem, &fit.bias)) else { return fit };
    let mut both = Fit { surface, misfit: 0.01 * fit.surface.radius.unwrap_or(1.0), ..fit.clone() };
    problem.refine(&mut both, 4, 2, 0.2);
    if likelihood(problem, &both) > before { both } else { fit }
}

fn oriented(problem: &Problem, bias: &DepthBias) -> Vec<Oriented> {
    let usable = problem.patches.list.iter().filter(|p| p.smooth && p.sigma_normal < 0.3);
    usable
        .map(|p| {
            let d = if problem.patches.cloud { 0.0 } else { bias.true_depth(p.measured) };
            Oriented {
                p: p.at(d),
                n: p.normal,
                angle: 0.2 + 3.0 * p.sigma_normal,
                slack: 2.0 * p.scatter / p.count.sqrt(),
            }
        })
        .filter(|o| o.p.x.is_finite() && o.p.z.is_finite())
        .collect()
}

/// Log-likelihood gain of calling patches wall instead of anything else.
fn likelihood(problem: &Problem, fit: &Fit) -> f64 {
    let placed = PlacedSurface::new(fit.surface);
    let gain = |(i, &weight): (usize, &f64)| {
        let equation = if weight > 0.0 { problem.equation(fit, &placed, i) } else { None };
        equation.map_or(0.0, |e| weight * (0.5 / (e.variance.sqrt() * e.cosine)).ln().max(0.0))
    };
    fit.weights.iter().enumerate().map(gain).sum()
}

/// Patches that agree with the wall and whose neighbours do too: the seam with feed or clutter is left out.
pub fn wall_patches(problem: &Problem, fit: &Fit) -> Vec<bool> {
    let placed = PlacedSurface::new(fit.surface);
    let agrees: Vec<bool> = (0..problem.patches.list.len())
        .map(|i| problem.equation(fit, &placed, i).is_some_and(|e| problem.weight(&e, i, 0.15) > 0.2))
        .collect();
    if problem.patches.cloud {
        return agrees;
    }
    let seam = |i: usize| {
        let near = &problem.patches.neighbours[i];
        let foreign = near.iter().filter(|&&n| n != NONE && !agrees[n as usize]);
        foreign.count() > 1
    };
    (0..agrees.len()).map(|i| agrees[i] && !seam(i)).collect()
}

/// Gauss–Newton on pixel residuals at every `stride`-th pixel; returns the noise law that they show.
fn polish(
    problem: &Problem,
    image: &DepthImage,
    fit: &mut Fit,
    wall: &[bool],
    (stride, reach): (usize, f64),
    known: Option<NoiseLaw>,
) -> NoiseLaw {
    let equations = pixel_equations(problem, image, fit, wall, (stride, reach));
    let noise = known.unwrap_or_else(|| {
        let mut samples: Vec<(f64, f64)> =
            equations.iter().map(|(i, _, scatter)| (problem.patches.list[*i].measured, *scatter)).collect();
        noise_from_scatter(&mut samples, 1e-5)
    });
    solve_equations(problem, fit, &equations);
    noise
}

/// Equations of the wall's tiles from their pixels: (patch, equation, scatter of its pixels).
fn pixel_equations(
    problem: &Problem,
    image: &DepthImage,
    fit: &Fit,
    wall: &[bool],
    (stride, reach): (usize, f64),
) -> Vec<(usize, Equation, f64)> {
    let placed = PlacedSurface::new(fit.surface);
    let tile = |i: usize| {
        let (d, _) = placed.depth(&problem.patches.list[i].q);
        let equation = problem.equation_at(fit, &placed, i, d)?;
        let reach = reach * 4.0 * fit.misfit / equation.cosine;
        let seen = tile_residual(image, problem.patches, i, &placed, &fit.bias, &problem.noise, (stride, reach));
        if !seen.pure || seen.count * ((stride * stride) as f64) < 0.5 * problem.patches.list[i].count {
            return None;
        }
        let misfit = fit.misfit / equation.cosine;
        let noise = (equation.variance - misfit * misfit).max(0.0) * problem.patches.list[i].count / seen.count;
        Some((i, Equation { residual: seen.mean, variance: noise, ..equation }, seen.scatter))
    };
    (0..wall.len()).filter(|&i| wall[i]).filter_map(tile).collect()
}

/// Robust solution of linear equations: reweighted a few times, the misfit re-estimated on the way.
fn solve_equations(
    problem: &Problem,
    fit: &mut Fit,
    equations: &[(usize, Equation, f64)],
) -> Option<(System, Parameters)> {
    let mut total = Parameters::zeros();
    let mut misfit = fit.misfit;
    let mut system = System::with_prior(problem.prior, fit);
    for _ in 0..4 {
        system = System::with_prior(problem.prior, fit);
        for (_, equation, _) in equations {
            let moved = moved(equation, &total, misfit);
            system.add(&moved, tukey(moved.residual * moved.residual / moved.variance));
        }
        // the residuals are already moved by `total`, the prior is not
        system.gradient += system.prior * total;
        let step = system.solve(fit)?;
        total += step;
        misfit = misfit_of(equations, &total);
    }
    fit.surface = fit.surface.stepped(&total);
    fit.bias.offset += total[7];
    fit.bias.scale += total[8];
    fit.bias.quadratic += total[9];
    fit.misfit = misfit;
    Some((system, total))
}

fn moved(equation: &Equation, step: &Parameters, misfit: f64) -> Equation {
    let across = misfit / equation.cosine;
    Equation {
        residual: equation.residual + equation.jacobian.dot(step),
        variance: equation.variance + across * across,
        ..*equation
    }
}

/// Misfit across the wall that the tiles' residuals need beside their noise.
fn misfit_of(equations: &[(usize, Equation, f64)], step: &Parameters) -> f64 {
    let mut excess: Vec<f64> = Vec::with_capacity(equations.len());
    let mut noise: Vec<f64> = Vec::with_capacity(equations.len());
    for (_, e, _) in equations {
        let across = (e.residual + e.jacobian.dot(step)) * e.cosine;
        excess.push(across.abs());
        noise.push(e.variance * e.cosine * e.cosine);
    }
    if excess.is_empty() {
        return 0.0;
    }
    let middle = excess.len() / 2;
    let (_, &mut spread, _) = excess.select_nth_unstable_by(middle, f64::total_cmp);
    let (_, &mut noise, _) = noise.select_nth_unstable_by(middle, f64::total_cmp);
    ((1.4826 * spread).powi(2) - 1.2 * noise).max(0.0).sqrt().max(1e-6)
}

/// Last solution, covariance and evidence.
fn finish(
    problem: &Problem,
    mut fit: Fit,
    wall: Vec<bool>,
    equations: Vec<(usize, Equation, f64)>,
) -> Option<SurfaceFit> {
    let (system, total) = solve_equations(problem, &mut fit, &equations)?;
    let final_equations: Vec<(usize, Equation)> =
        equations.iter().map(|(i, e, _)| (*i, moved(e, &total, fit.misfit))).collect();
    let (model, free) = system.covariance(&fit)?;
    let mut covariance = widened(problem, &model, &system, &final_equations);
    if !free[8] {
        covariance += scale_uncertainty(&fit, problem.prior.bias_std[1]);
    }
    let placed = PlacedSurface::new(fit.surface);
    let mut used = vec![false; wall.len()];
    let mut residuals = vec![f64::NAN; wall.len()];
    let (mut chi, mut weights) = (0.0, 0.0);
    for (i, e) in &final_equations {
        let squared = e.residual * e.residual / e.variance;
        let weight = tukey(squared);
        residuals[*i] = e.residual * e.cosine;
        used[*i] = weight > 0.0;
        chi += weight * squared;
        weights += weight;
    }
    let evidence = wall_evidence(problem.patches, &fit, &placed, &used);
    let mut information = system.information - system.prior;
    information.fill_lower_triangle_with_upper_triangle();
    Some(SurfaceFit {
        covariance,
        information,
        free,
        noise: problem.noise,
        chi_square: chi / f64::max(weights, 1.0),
        evidence,
        patches: problem.patches.clone(),
        wall: used,
        residuals,
        fit,
        timing: Vec::new(),
    })
}

/// The model's covariance, widened in those directions in which blocks of tiles disagree more than it says.
///
/// Residuals that are correlated over many tiles (dents, corrugation, a warped lens) don't average out as noise does.
/// The sum over blocks of the outer product of their gradients estimates what they really do to the parameters.
fn widened(problem: &Problem, model: &Information, system: &System, equations: &[(usize, Equation)]) -> Information {
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
fn scale_uncertainty(fit: &Fit, std: f64) -> Information {
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

/// Surface and bias of the fit, for callers that only draw.
impl SurfaceFit {
    /// The wall.
    pub fn surface(&self) -> &SiloSurface {
        &self.fit.surface
    }

    /// The depth bias.
    pub fn bias(&self) -> &DepthBias {
        &self.fit.bias
    }
}
