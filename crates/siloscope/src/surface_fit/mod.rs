//! The surface fit: a depth frame in, the silo's wall as cylinder and cone out, with its covariance.

pub mod bow;
pub mod cloud;
pub mod cloud_equations;
pub mod cloud_tiles;
pub mod common;
pub mod covariance;
pub mod diagnostics;
pub mod equation;
pub mod factor;
pub mod frame_factor;
pub mod grain;
pub mod joint;
pub mod likelihood;
mod misfit;
pub mod model_selection;
pub mod normal_equations;
pub mod orthogonal;
pub mod outcome;
pub mod outermost;
pub mod parts;
pub mod polish;
pub mod profile_parts;
pub mod proposals;
pub mod residual;
pub mod segmentation;
pub mod solver;
pub mod state;
pub mod taper;
pub mod tile_plane;
pub mod tile_rays;
pub mod tiles;
pub mod vertex;
pub mod warm_start;

use crate::SiloPose;
use crate::Vec3;
use crate::base::clock::Clock;
use crate::base::refusal::Refusal;
use crate::geometry::depth_image::DepthImage;
use crate::geometry::evaluator::SurfaceEvaluator;
use crate::geometry::parameters::{BIAS, Information, OVALITY, PARAMETERS};
use crate::geometry::sensor::NoiseLaw;
use crate::geometry::surface::SurfaceTolerance;
use crate::surface_fit::bow::bow_uncertainty;
use crate::surface_fit::common::lasting_misfit;
use crate::surface_fit::covariance::{
    relief, relief_beside_noise, relief_uncertainty, scale_uncertainty, shows_ovality, widened,
};
use crate::surface_fit::diagnostics::WallEvidence;
use crate::surface_fit::factor::{frame_factor, some_rays};
use crate::surface_fit::frame_factor::restrict;
use crate::surface_fit::grain::relief_with_grain;
use crate::surface_fit::joint::model::Inputs;
use crate::surface_fit::joint::{Start, fit_inside};
use crate::surface_fit::likelihood::may_be_feed;
use crate::surface_fit::model_selection::{Settled, coarse_fit, drop_film};
use crate::surface_fit::outcome::check_determined;
pub use crate::surface_fit::outcome::{Knowledge, Outcome, SurfaceFit, Vessels};
use crate::surface_fit::parts::change_without_a_part;
use crate::surface_fit::polish::{ALL, TileEquation, pixel_equations, polish, solve_equations};
use crate::surface_fit::solver::{Fit, OVALITY_STD, Prior, Problem, free_parameters, tukey};
use crate::surface_fit::tiles::{Patch, Patches, noise_from_scatter, tile_patches};
use crate::surface_fit::warm_start::{KnownWall, confirmed};

/// How far a wall that shows ovality, and so is no ideal one, lies off its mean over a block of tiles, metres.
const WALL_FORM: f64 = 2.5e-4;
/// The same as a multiple of the misfit that the tiles show: what stuck feed and dents do to neighbouring tiles alike.
const MISFIT_FORM: f64 = 2.0;
/// Misfit that chance alone shows on a smooth wall, metres.
const CHANCE_MISFIT: f64 = 2e-4;

/// Largest share of the wall that dents and seams put before it; where it is more, feed sticks to it.
const DENTED: f64 = 0.06;
/// How thick the feed is that sticks to such a wall unnoticed, metres.
const FILM_FORM: f64 = 1e-3;

/// How far the wall may lie off its mean over a block of tiles, metres.
fn form(misfit: f64, oval: bool) -> f64 {
    MISFIT_FORM * (misfit - CHANCE_MISFIT).max(0.0) + if oval { WALL_FORM } else { 0.0 }
}

/// Fits the wall to a depth image; where another frame of the camera has shown a wall, it is looked for there first.
pub fn fit_image(image: &DepthImage, know: &Knowledge, known: Option<&KnownWall>) -> Outcome {
    let mut clock = Clock::start();
    let mut patches = tile_patches(image, know.error.noise.as_ref());
    if patches.list.len() < 30 {
        return Err(Refusal::NoDepth);
    }
    patches.unbias_normals(&know.error.bias);
    clock.lap("patches");
    let (noise, prior, pixel) = (noise(&patches, know), prior(know), image.pixel_size());
    let confirmed = known.and_then(|wall| {
        let found = match know.vessels {
            Vessels::Any { .. } if wall.inside => {
                if prior.bias_std[2] > 0.0 {
                    patches.unbias_normals(&wall.bias);
                }
                let problem = Problem { patches: &patches, noise, prior: &prior, pixel };
                fit_inside(&problem, image, know, Start::Known(wall), &mut clock)
            }
            _ => {
                let found = confirmed(&mut patches, noise, &prior, pixel, wall);
                clock.lap("known wall");
                let problem = Problem { patches: &patches, noise, prior: &prior, pixel };
                measured(problem, image, know, found?, Looks::None, &mut clock)
            }
        };
        found.ok().filter(|fit| fit.confirms(wall))
    });
    let mut result = match confirmed {
        Some(fit) => fit,
        None => {
            patches.unbias_normals(&know.error.bias);
            let (found, proposals) = coarse_fit(&mut patches, noise, &prior, pixel);
            clock.lap("coarse fit");
            let problem = Problem { patches: &patches, noise, prior: &prior, pixel };
            match found {
                Ok(found) => fit_from(problem, image, know, (found, &proposals), &mut clock)?,
                Err(why) if know.vessels == Vessels::Coaxial => return Err(why),
                Err(why) => fit_inside(&problem, image, know, Start::Searched(None, &proposals), &mut clock)
                    .map_err(|own| if own == Refusal::NoWall { why } else { own })?,
            }
        }
    };
    result.timing = clock.laps();
    result.patches = patches;
    Ok(result)
}

/// The vessel from a wall found on tiles: by the joint fit, or by its pixels where it is a coaxial one or seen from outside.
fn fit_from(
    problem: Problem,
    image: &DepthImage,
    know: &Knowledge,
    (found, proposals): (Settled, &[Fit]),
    clock: &mut Clock,
) -> Outcome {
    match know.vessels {
        Vessels::Any { .. } if found.fit.inside => {
            fit_inside(&problem, image, know, Start::Searched(Some(&found), proposals), clock)
        }
        _ => measured(problem, image, know, found, Looks::Usual, clock),
    }
}

/// The wall that patches have settled on, measured by its pixels.
fn measured(
    problem: Problem,
    image: &DepthImage,
    know: &Knowledge,
    found: Settled,
    looks: Looks,
    clock: &mut Clock,
) -> Outcome {
    let mut known = KnownWall::of(&found);
    let Settled { mut fit, wall, evidence, bare } = found;
    let round = fit.surface.ovality == [0.0; 2];
    let prior = if round { problem.prior.clone() } else { problem.prior.with_ovality() };
    let problem = Problem { prior: &prior, ..problem };
    if let (Some((radius, _)), true) = (know.radius, prior.bias_std[1] > 0.0) {
        fit.rescale_to(radius); // few patches of the cylinder tell the scale, though they leave its radius open
    }
    fit.surface = fit.surface.without(bare);
    drop_film(&problem, &mut fit, &wall);
    known.drop_parts_without(&fit.surface);
    let (noise, mut equations) = on_pixels(problem, image, &mut fit, &wall, know.error.noise, looks);
    let problem = Problem { noise, ..problem };
    if may_be_feed(&problem, &fit) {
        // on its pixels the cone is less steep than on patches
        fit.surface.radius.ok_or(Refusal::ConeMayBeFeed)?;
        fit.surface.cone = None;
        known.drop_parts_without(&fit.surface);
        (_, equations) = on_pixels(problem, image, &mut fit, &wall, Some(noise), Looks::Usual);
    }
    let oval = prior.with_ovality();
    known.oval = !round || shows_ovality(&problem, &fit, &mut equations, OVALITY_STD);
    let problem = if known.oval { Problem { prior: &oval, ..problem } } else { problem };
    if known.oval && round {
        (_, equations) = on_pixels(problem, image, &mut fit, &wall, Some(noise), Looks::Usual);
    }
    clock.lap("pixels");
    let relief = if know.error.noise.is_some() { relief(&equations) } else { relief_beside_noise(&equations) };
    let relief = relief_with_grain(&problem, image, &fit, &equations, relief);
    let mut result = finish(&problem, fit.clone(), &mut equations, (evidence, known), relief)?;
    for _ in 0..MOST_ROUNDS {
        if result.fit.surface.is_near(&fit.surface, &LINEAR) {
            break;
        }
        fit = result.fit;
        equations = pixel_equations(&problem, image, &fit, &wall, &ALL);
        result = finish(&problem, fit.clone(), &mut equations, (evidence, known), relief)?;
    }
    clock.lap("covariance");
    Ok(result)
}

/// So near to where they were made equations are as good as linear: what is left out is a hundredth of the step.
const LINEAR: SurfaceTolerance = SurfaceTolerance { tilt: 0.003, shift: 0.01, radius: 0.01, slope: 0.1, apex: 0.1 };
/// So often equations are made anew where the answer is further away, as it is where a frame leaves much open.
const MOST_ROUNDS: usize = 4;

/// How often the pixels are looked at before they are all asked.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Looks {
    /// As often as it takes from a wall found on patches.
    Usual,
    /// Not where the noise is known: the wall lies so near the answer that its equations are as good as linear.
    None,
}

/// Steps on some of the pixels, then the equations of all; and the noise law, from the residuals where none is known.
fn on_pixels(
    mut problem: Problem,
    image: &DepthImage,
    fit: &mut Fit,
    wall: &[bool],
    known: Option<NoiseLaw>,
    looks: Looks,
) -> (NoiseLaw, Vec<TileEquation>) {
    let reaches: &[f64] = match (known, looks) {
        (Some(_), Looks::None) => &[],
        (Some(_), Looks::Usual) => &[3.0],
        (None, _) => &[3.0, 2.0], // a noise law asks for a second look
    };
    for &reach in reaches {
        problem.noise = polish(&problem, image, fit, wall, reach, known);
    }
    (problem.noise, pixel_equations(&problem, image, fit, wall, &ALL))
}

impl SurfaceFit {
    /// Centres of the patches in the silo frame, freed from the depth bias: what the r–z profile shows.
    pub fn patch_points(&self) -> Vec<Vec3> {
        let placed = SurfaceEvaluator::new(self.fit.surface);
        let to_silo = |p: &Patch| {
            let d = if self.patches.cloud { 0.0 } else { self.fit.bias.true_depth(p.measured) };
            placed.to_silo(&p.at(d))
        };
        self.patches.list.iter().map(to_silo).collect()
    }

    /// Whether it shows a known wall again: the same parts in the same place, and oval if that was.
    fn confirms(&self, wall: &KnownWall) -> bool {
        self.wall.oval == wall.oval && wall.is_same(&self.wall.surface)
    }

    /// Whether most of the wall's normals, turned towards the origin, point to the axis.
    fn is_seen_from_inside(&self) -> bool {
        let placed = SurfaceEvaluator::new(self.fit.surface);
        let wall = self.residuals.iter().zip(&self.patches.list).filter(|(r, _)| r.is_finite());
        let inwards = |p: &Patch| placed.turn(&p.normal).dot(&placed.local(&p.origin).gradient) < 0.0;
        let votes: i64 = wall.map(|(_, p)| if inwards(p) { 1 } else { -1 }).sum();
        votes > 0
    }
}

fn noise(patches: &Patches, know: &Knowledge) -> NoiseLaw {
    know.error.noise.unwrap_or_else(|| {
        let smooth = patches.list.iter().filter(|p| p.smooth);
        noise_from_scatter(&mut smooth.map(|p| (p.measured, p.scatter)).collect::<Vec<_>>(), 1e-4)
    })
}

fn prior(know: &Knowledge) -> Prior {
    let mut bias_std = know.error.bias_std;
    if know.radius.is_some() && bias_std[1] > 0.0 {
        bias_std[1] = bias_std[1].max(0.05); // a known radius fixes the scale better than any expectation
    }
    Prior { bias: know.error.bias, bias_std, radius: know.radius, gravity: know.gravity, ovality_std: 0.0 }
}

/// Last solution, covariance and residuals.
fn finish(
    problem: &Problem,
    mut fit: Fit,
    tiles: &mut [TileEquation],
    (evidence, wall): (WallEvidence, KnownWall),
    relief: f64,
) -> Outcome {
    let system = solve_equations(problem, &mut fit, tiles, 4).ok_or(Refusal::PoorlyDetermined)?;
    let pulls: Vec<f64> = tiles.iter().map(TileEquation::pull).collect();
    let free = free_parameters(&fit, &system.prior);
    let joint = if problem.patches.cloud { system } else { system.with_ovality(OVALITY_STD) };
    let (model, jointly_free) = joint.covariance(&fit).ok_or(Refusal::PoorlyDetermined)?;
    let mut covariance = widened(problem, &model, &joint, (tiles, &pulls));
    let lasting = lasting_misfit(problem.patches, fit.misfit, tiles);
    let form = form(lasting, free[OVALITY]);
    let off_by = |form: f64| relief_uncertainty(&joint, &fit, tiles, (relief, form));
    let film = if evidence.stuck > DENTED { off_by(form.max(FILM_FORM)) } else { Information::zeros() };
    covariance += off_by(form);
    let heights = tiles.iter().map(|t| t.equation.z).sum::<f64>();
    let placed = SurfaceEvaluator::new(fit.surface);
    check_determined(&covariance, &placed, heights / tiles.len().max(1) as f64)?;
    covariance += film + bow_uncertainty(&fit, tiles); // these widen an answer, but take none away
    if let Some(change) = change_without_a_part(&fit, &joint, (&model, &covariance), (tiles, &pulls), free[OVALITY]) {
        covariance += change * change.transpose();
    }
    let bias_is_free = free[7..OVALITY].contains(&true);
    let rays = if bias_is_free { some_rays(tiles, |patch| problem.patches.list[patch].q) } else { Vec::new() };
    let scale_std = if free[8] { 0.0 } else { problem.prior.bias_std[1] };
    let known = (inputs(problem.prior, &free), scale_std, rays);
    let solved = (&joint, &model, &covariance);
    let factor = frame_factor(&fit, solved, (tiles, &pulls), (&free, &jointly_free), known);
    let mut covariance = restrict(&covariance, &free);
    covariance += scale_uncertainty(&fit, scale_std);
    let (residuals, chi_square) = residuals(tiles, problem.patches.list.len());
    Ok(SurfaceFit {
        covariance,
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
