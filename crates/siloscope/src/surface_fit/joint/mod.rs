//! The joint fit: vessel models that compete as wholes, with the wall's form and the intrinsics as parameters.
//!
//! 1. `search`: fits from the tile stage's answer, or from all its proposals with a falling model error;
//! 2. `solve`: one fit: relinearise, `label` the tiles, solve the `system`, learn the widths;
//! 3. `select`: Laplace evidence of every `model`, and the mean over them;
//! 4. `answer`: refusals, and the answer in the parameters that frames share.

pub mod against;
pub mod answer;
pub mod average;
pub mod blocks;
pub mod correlation;
pub mod ends;
pub mod factor;
pub mod form;
pub mod form_share;
pub mod frame;
pub mod judge;
pub mod labels;
pub mod model;
pub mod parameters;
pub mod pixels;
pub mod predict;
pub mod readings;
pub mod search;
pub mod select;
pub mod solve;
pub mod summary;
pub mod system;

use crate::SiloPose;
use crate::Vec3;
use crate::base::clock::Clock;
use crate::base::refusal::Refusal;
use crate::geometry::depth_image::DepthImage;
use crate::geometry::evaluator::SurfaceEvaluator;
use crate::geometry::surface::{Cone, Part, SiloSurface, SurfaceTolerance};
use crate::surface_fit::diagnostics::{WallEvidence, wall_evidence};
use crate::surface_fit::frame_factor::FrameFactor;
use crate::surface_fit::joint::answer::{JointAnswer, answer};
use crate::surface_fit::joint::factor::frame_factor;
use crate::surface_fit::joint::form::Form;
use crate::surface_fit::joint::frame::Frame;
use crate::surface_fit::joint::judge::{LEAST_ARC_ALONE, MOST_BEHIND, is_ambiguous, judge, judge_wall};
use crate::surface_fit::joint::model::{HOPPER_SLOPE, Inputs, Model};
use crate::surface_fit::joint::parameters::{INTERCEPT, SLOPE};
use crate::surface_fit::joint::readings::Readings;
use crate::surface_fit::joint::search::{Search, arc, search, search_again, wall_tiles};
use crate::surface_fit::joint::solve::JointFit;
use crate::surface_fit::joint::summary::JointSummary;
use crate::surface_fit::model_selection::{Settled, oriented};
use crate::surface_fit::outcome::{
    Knowledge, MAX_DIRECTION_STD, MAX_POSITION_STD, Outcome, SurfaceFit, check_determined,
};
use crate::surface_fit::profile_parts::other_part;
use crate::surface_fit::solver::{Fit, Problem};
use crate::surface_fit::tiles::{NONE, Patches};
use crate::surface_fit::vertex::is_covered;
use crate::surface_fit::warm_start::KnownWall;

/// Near enough to a wall found on tiles for what was measured there to hold.
const SAME: SurfaceTolerance = SurfaceTolerance { tilt: 0.003, shift: 0.01, radius: 0.01, slope: 0.1, apex: 0.1 };
/// Fewest tiles of a cone that tell whether it is one.
const LEAST_CONE: f64 = 60.0;
/// Model error of a cone beyond its cylinder's that is a surface of feed, metres.
const RIPPLED: f64 = 1e-3;

/// From where a vessel is fitted.
#[derive(Debug, Clone, Copy)]
pub enum Start<'a> {
    /// From a wall found on tiles, where there is one, and rougher proposals.
    Searched(Option<&'a Settled>, &'a [Fit]),
    /// From the wall of another frame, which has stood up to all evidence.
    Known(&'a KnownWall),
}

/// Fits the vessel to an image seen from inside.
pub fn fit_inside(problem: &Problem, image: &DepthImage, know: &Knowledge, start: Start, clock: &mut Clock) -> Outcome {
    if know.gravity.is_some_and(|(down, _)| down.z <= 0.0) {
        return Err(Refusal::AboveHorizon);
    }
    let scale_is_free = know.radius.is_some() && problem.prior.bias_std[1] > 0.0;
    let readings = Readings::new(problem.patches, &problem.noise, &know.error.bias, problem.pixel);
    let (inputs, form) = (inputs(problem, know, scale_is_free), Form::default());
    let frame = Frame { readings: &readings, image, form: &form, inputs: &inputs, told_cone: know.told_cone };
    let placed = |fit: &Fit| {
        let mut fit = fit.clone();
        if let (Some((radius, _)), true) = (know.radius, scale_is_free) {
            fit.rescale_to(radius);
        }
        fit
    };
    let bias = know.error.bias;
    let (found, near) = match start {
        Start::Known(wall) => (search_again(&frame, &placed(&wall.fit())).ok_or(Refusal::NoWall)?, None),
        Start::Searched(near, proposals) => {
            let near = near.map(|s| Settled { fit: placed(&s.fit), ..s.clone() });
            let from = near.as_ref().map(|s| Fit { surface: s.fit.surface.without(s.bare), ..s.fit.clone() });
            let proposals: Vec<Fit> = proposals.iter().map(placed).collect();
            let oriented = oriented(problem, &bias);
            (search(&frame, from.as_ref(), &proposals, |surface| other_part(surface, &oriented)), near)
        }
    };
    let known = matches!(start, Start::Known(_));
    clock.lap(if known { "known wall" } else { "models" });
    if know.judged {
        judge(&frame, &found, known)?;
    }
    let scale = if scale_is_free { 0.0 } else { know.error.bias_std[1] };
    let outcome = told(problem, &frame, (&found, know.judged), scale, near.as_ref());
    clock.lap("answer");
    outcome
}

fn inputs(problem: &Problem, know: &Knowledge, scale_is_free: bool) -> Inputs {
    let mut bias_std = problem.prior.bias_std;
    if !scale_is_free {
        bias_std[1] = 0.0;
    }
    let gravity = know.gravity.map(|(down, std)| (SiloPose::from_axis(&down, &Vec3::zeros()), std));
    Inputs { bias: know.error.bias, bias_std, radius: know.radius, gravity, camera_std: know.camera_std }
}

/// The answer of a search, if it stands up to the evidence of a wall of revolution, and where it is judged, if it is sure.
fn told(
    problem: &Problem,
    frame: &Frame,
    (found, judged): (&Search, bool),
    scale: f64,
    near: Option<&Settled>,
) -> Outcome {
    let best = found.weighed.first().ok_or(Refusal::NoWall)?;
    let fit = found.fits.get(best.fit).ok_or(Refusal::NoWall)?;
    let tiles = tile_fit(fit, best.model);
    let placed = SurfaceEvaluator::new(tiles.surface);
    let with_cone = tiles.surface.cone.is_some();
    let on_wall =
        |i: usize| fit.labels.wall[i] > 0.5 && fit.sights[i].is_some_and(|s| with_cone || s.at.part == Part::Cylinder);
    let foreign = |&&n: &&u32| n != NONE && !on_wall(n as usize);
    let inside = |i: usize| on_wall(i) && problem.patches.neighbours[i].iter().filter(foreign).count() < 2;
    let wall: Vec<bool> = (0..fit.sights.len()).map(inside).collect();
    let same = near.filter(|near| found.fits.len() == 1 && near.fit.surface.is_near(&tiles.surface, &SAME));
    let evidence = same.map_or_else(|| wall_evidence(problem.patches, &tiles, &placed, &wall), |near| near.evidence);
    let hopper = is_hopper(problem, fit, best.model) && evidence.behind_cone < MOST_BEHIND;
    judge_wall(fit, &evidence)?;
    let answer = answer(frame, found, hopper, scale).ok_or(Refusal::PoorlyDetermined)?;
    let heights = fit.sights.iter().zip(&fit.labels.wall).filter(|(_, p)| **p > 0.5).filter_map(|(s, _)| *s);
    let (sum, n) = heights.fold((0.0, 0.0), |(sum, n), s| (sum + s.at.z, n + 1.0));
    if judged {
        if is_ambiguous(found, MAX_DIRECTION_STD, MAX_POSITION_STD * fit.state.size()) {
            return Err(Refusal::AmbiguousVessel);
        }
        check_determined(&answer.covariance, &SurfaceEvaluator::new(answer.surface), sum / f64::max(n, 1.0))?;
    }
    let factor = frame_factor(frame, fit, (best.model, hopper), scale);
    Ok(surface_fit(problem, (fit, best.model), (answer, factor), evidence, near))
}

/// Whether the cone is the silo's own: coaxial or oblique, and steeper than feed lies or with feed in it.
fn is_hopper(problem: &Problem, fit: &JointFit, model: Model) -> bool {
    if !matches!(model, Model::CoaxialCone | Model::ObliqueCone) {
        return false;
    }
    let smooth = fit.tau[1] < fit.tau[0] + RIPPLED;
    let seen = wall_tiles(fit)[1] > LEAST_CONE && arc(fit, Part::Cone) > LEAST_ARC_ALONE;
    seen && smooth && (fit.state.x[SLOPE] < HOPPER_SLOPE || is_covered(problem, &tile_fit(fit, Model::CoaxialCone)))
}

/// The fit as cylinder and coaxial cone; without a cone that is not coaxial.
fn tile_fit(fit: &JointFit, model: Model) -> Fit {
    let cone = matches!(model, Model::CoaxialCone | Model::ConeAlone) && fit.state.has_cone;
    let surface = SiloSurface {
        pose: fit.state.pose(),
        radius: fit.state.vessel().radius,
        cone: cone.then(|| Cone::with_intercept(fit.state.x[SLOPE], fit.state.x[INTERCEPT])),
        ovality: [0.0; 2],
    };
    Fit { surface, bias: fit.state.bias(), inside: true, misfit: fit.tau[0].max(2e-4), weights: Vec::new() }
}

fn surface_fit(
    problem: &Problem,
    (fit, model): (&JointFit, Model),
    (answer, factor): (JointAnswer, FrameFactor),
    evidence: WallEvidence,
    near: Option<&Settled>,
) -> SurfaceFit {
    let bias = fit.state.bias();
    let tiles =
        Fit { surface: answer.surface, bias, inside: true, misfit: fit.tau[0].max(fit.tau[1]), weights: Vec::new() };
    let shown = tile_fit(fit, model).surface; // its cone may be no hopper's, and still be there in the next frame
    let mut wall = KnownWall { surface: shown, bias, inside: true, misfit: tiles.misfit };
    if let Some(near) = near {
        wall = KnownWall::of(near);
        wall.drop_parts_without(&shown);
    }
    let (mut residuals, mut chi, mut weights) = (vec![f64::NAN; fit.sights.len()], 0.0, 0.0);
    for (i, sight) in fit.sights.iter().enumerate() {
        if let Some(sight) = sight.filter(|_| fit.labels.wall[i] > 0.5) {
            let norm = sight.at.gradient_norm();
            residuals[i] = sight.residual * sight.rate / norm;
            chi += fit.labels.wall[i] * sight.residual * sight.residual / fit.labels.variance[i];
            weights += fit.labels.wall[i];
        }
    }
    SurfaceFit {
        covariance: answer.covariance,
        factor,
        free: answer.free,
        noise: problem.noise,
        chi_square: chi / f64::max(weights, 1.0),
        evidence,
        wall,
        patches: Patches::default(),
        residuals,
        fit: tiles,
        timing: Vec::new(),
        joint: Some(Box::new(JointSummary {
            tau: fit.tau,
            correlation: fit.correlation,
            amplitudes: fit.amplitudes.form,
            camera_factor: fit.amplitudes.camera,
            answer,
        })),
    }
}
