//! Whether weighed models are an answer, or the reason why there is none.

use crate::base::refusal::Refusal;
use crate::geometry::surface::Part;
use crate::surface_fit::diagnostics::WallEvidence;
use crate::surface_fit::joint::ends::judge_ends;
use crate::surface_fit::joint::form::{GROUPS, Group};
use crate::surface_fit::joint::frame::Frame;
use crate::surface_fit::joint::model::{Amplitudes, HOPPER_SLOPE, Model, prior};
use crate::surface_fit::joint::parameters::SLOPE;
use crate::surface_fit::joint::predict::{Predictor, Sight};
use crate::surface_fit::joint::search::{Search, arc, tiles_met, wall_tiles};
use crate::surface_fit::joint::solve::JointFit;

/// Most of the tiles' model error that is a wall's, as a fraction of the radius.
const MOST_TAU: f64 = 0.012;
/// The same for what its tiles have in common: model error times the root of the correlation factor.
const MOST_IN_COMMON: f64 = 0.015;
/// Largest correlation factor of a wall, and what its tiles must have in common for that to be another surface's, as a
/// fraction of the radius: ten times less than what is one by its size alone.
const MOST_CORRELATION: f64 = 45.0;
const LEAST_IN_COMMON: f64 = 0.0015;
/// Fewer tiles of the cylinder than these don't fix where it is.
const LEAST_CYLINDER: f64 = 12.0;
/// Fewer than this fraction leave it to the cone where the axis runs: it must be round and steeper than feed.
const WEAK_CYLINDER: f64 = 0.05;
/// Ovality amplitude, over its first value, beyond which a cone is not round: an oblique one is an oval right one.
const ROUND: f64 = 2.0;
/// Models with more probability than this that differ by more than the answer's limits make it ambiguous.
const COMPARABLE: f64 = 0.01;
/// Least arc that fixes where a cylinder alone runs, as a fraction of the circle: on 60° it rises a seventh of its radius.
pub const LEAST_ARC_ALONE: f64 = 1.0 / 6.0;
/// A contradiction of gravity by more than this many standard deviations is no chance.
const CONTRADICTION: f64 = 5.0;

/// Least fraction of the tiles that must be wall.
const LEAST_WALL: f64 = 0.03;
/// Fewest tiles of a wall.
const MIN_TILES: usize = 20;
/// Least arc of a wall, rad: less is as good as flat.
const MIN_ARC: f64 = 0.5;
/// How far the turn of a wall's normals is off that of its positions, beside chance.
const TURN: f64 = 0.06;
/// Bend of a wall along its height over that around: a barrel's begins at a quarter, noise and lenses reach a sixth.
const BEND: f64 = 0.2;
/// Largest fraction of the tiles that lies behind a wall.
pub const MOST_BEHIND: f64 = 0.05;
/// Further behind the wall than this fraction of the radius nothing can be.
const BEHIND: f64 = 0.05;
/// Fraction of the wall's tiles at either end that is left out of the heights on which it is seen.
const OUTLYING: f64 = 0.02;

/// Refuses what is no silo's wall, or not surely; a `known` wall need not show again that its axis is the cylinder's.
pub fn judge(frame: &Frame, search: &Search, known: bool) -> Result<(), Refusal> {
    let best = search.weighed.first().ok_or(Refusal::NoWall)?;
    let fit = search.fits.get(best.fit).ok_or(Refusal::NoWall)?;
    let [cylinder, cone] = wall_tiles(fit);
    let all = tiles_met(fit).max(1.0);
    if cylinder + cone < LEAST_WALL * all {
        return Err(Refusal::NoWall);
    }
    let tied = best.model != Model::FreeCone && cone > cylinder; // else the axis is the cylinder's alone
    let weak = tied && cylinder < WEAK_CYLINDER * all;
    let sound = fit.state.x[SLOPE] < HOPPER_SLOPE && is_round(fit);
    let agrees = frame.inputs.gravity.is_some() && agrees_with_gravity(frame, fit, best.model);
    let leads = best.model.is_cone_alone() || !known && (cylinder < LEAST_CYLINDER || weak && !sound);
    if leads && !agrees && !frame.told_cone {
        return Err(Refusal::ConeAlone);
    }
    let size = fit.state.size();
    let lead = leading_part(fit, best.model);
    let in_common = fit.tau[lead] * fit.correlation[lead].sqrt();
    let correlated = fit.correlation[lead] > MOST_CORRELATION && in_common > LEAST_IN_COMMON * size;
    if fit.tau[0] > MOST_TAU * size || in_common > MOST_IN_COMMON * size || correlated {
        return Err(Refusal::NoWall);
    }
    if frame.inputs.gravity.is_some() && !agrees {
        return Err(Refusal::GravityContradicts);
    }
    if is_deformed(frame, fit) {
        return Err(Refusal::Deformed);
    }
    if best.model == Model::Cylinder && arc(fit, Part::Cylinder) < LEAST_ARC_ALONE {
        return Err(Refusal::PoorlyDetermined);
    }
    judge_ends(frame, fit)
}

/// The part that leads the axis, by the weight of its tiles: 0 for the cylinder, 1 for a cone that is tied to it.
fn leading_part(fit: &JointFit, model: Model) -> usize {
    if model == Model::FreeCone {
        return 0;
    }
    let mut weights = [0.0; 2];
    for ((sight, wall), variance) in fit.sights.iter().zip(&fit.labels.wall).zip(&fit.labels.variance) {
        if let Some(sight) = sight {
            let part = usize::from(sight.at.part == Part::Cone);
            weights[part] += wall / (variance * fit.correlation[part]);
        }
    }
    usize::from(weights[1] > weights[0])
}

/// Whether the form that is seen goes beyond its caps: it is a deposit or another shape.
fn is_deformed(frame: &Frame, fit: &JointFit) -> bool {
    let seen = form_rms(frame, fit);
    GROUPS.into_iter().zip(seen).any(|(group, rms)| rms > group.bounds(fit.state.size()).cap)
}

/// Root mean square of each group's part of the form over the wall's tiles, metres.
fn form_rms(frame: &Frame, fit: &JointFit) -> [f64; GROUPS.len()] {
    let predictor = Predictor::new(&fit.state, frame.form);
    let (mut squares, mut weights) = ([0.0; GROUPS.len()], 0.0);
    for (sight, wall) in fit.sights.iter().zip(&fit.labels.wall) {
        let Some(sight) = sight else { continue };
        let bulges = predictor.bulge_by_group(sight);
        squares.iter_mut().zip(bulges).for_each(|(sum, bulge)| *sum += wall * bulge * bulge);
        weights += wall;
    }
    squares.map(|sum| (sum / f64::max(weights, 1.0)).sqrt())
}

/// Whether the wall shows no more ovality than is expected of any.
fn is_round(fit: &JointFit) -> bool {
    let first = Amplitudes::first(fit.state.size()).form;
    GROUPS
        .iter()
        .zip(fit.amplitudes.form.iter().zip(first))
        .all(|(g, (a, first))| *g != Group::Oval || *a < ROUND * first)
}

/// Whether the axis without the gravity prior agrees with gravity.
fn agrees_with_gravity(frame: &Frame, fit: &JointFit, model: Model) -> bool {
    let Some((pose, std)) = frame.inputs.gravity else { return true };
    let first = Amplitudes::first(fit.state.size()); // a form that was bent to meet gravity is none
    let mut prior = prior(model, &fit.state, frame.inputs, frame.form, Some(&first));
    prior.mean[..2].copy_from_slice(&fit.state.x[..2]);
    prior.std[..2].fill(1.0);
    let Some(free) = fit.quadratic.posterior(&fit.state.x, &prior) else { return false };
    let covariance = free.covariance();
    let off = [pose.r_x - fit.state.x[0] - free.step[0], pose.r_y - fit.state.x[1] - free.step[1]];
    let spread = nalgebra::Matrix2::new(
        covariance[(0, 0)] + (std / pose.r_y.cos().abs().max(1e-3)).powi(2),
        covariance[(0, 1)],
        covariance[(1, 0)],
        covariance[(1, 1)] + std * std,
    );
    let off = nalgebra::Vector2::from(off);
    spread.try_inverse().is_some_and(|inverse| off.dot(&(inverse * off)) < CONTRADICTION * CONTRADICTION)
}

/// What has to hold of the wall beside what the fit says: it turns about the axis, and nothing lies behind it.
pub fn judge_wall(fit: &JointFit, evidence: &WallEvidence) -> Result<(), Refusal> {
    if evidence.patches < MIN_TILES || evidence.arc < MIN_ARC {
        return Err(Refusal::NoWall);
    }
    let [turn, turn_std] = match evidence.turn_of_cylinder {
        [turn, std] if 3.0 * std < TURN => [turn, std], // fewer tiles don't tell
        _ => [evidence.turn, evidence.turn_std],
    };
    if (turn - 1.0).abs() > TURN + 3.0 * turn_std {
        return Err(Refusal::Flat);
    }
    if evidence.bend.abs() > BEND + 3.0 * evidence.bend_std {
        return Err(Refusal::Bent);
    }
    if behind(fit) > MOST_BEHIND {
        return Err(Refusal::BehindWall);
    }
    Ok(())
}

/// Fraction of the tiles that lie behind the cylinder at heights on which it is seen: below, a vessel may be wider.
fn behind(fit: &JointFit) -> f64 {
    let on_cylinder = || {
        fit.sights
            .iter()
            .zip(&fit.labels.wall)
            .filter_map(|(s, p)| Some((s.as_ref()?, *p)))
            .filter(|(s, _)| s.at.part == Part::Cylinder)
    };
    let mut heights: Vec<f64> = on_cylinder().filter(|(_, p)| *p > 0.5).map(|(s, _)| s.at.z).collect();
    heights.sort_by(f64::total_cmp);
    let outlying = (OUTLYING * heights.len() as f64) as usize;
    let (Some(high), Some(low)) = (heights.get(outlying), heights.iter().rev().nth(outlying)) else { return 0.0 };
    let reach = BEHIND * fit.state.size();
    let is_behind = |s: &Sight| s.residual * s.rate > reach && s.at.z > *high && s.at.z < *low;
    on_cylinder().filter(|(s, p)| *p < 0.5 && is_behind(s)).count() as f64 / tiles_met(fit).max(1.0)
}

/// Whether models that are comparable differ by more than an answer may.
pub fn is_ambiguous(search: &Search, direction: f64, position: f64) -> bool {
    let Some(best) = search.weighed.first() else { return true };
    search.weighed.iter().filter(|w| w.probability > COMPARABLE).any(|w| {
        let off = |k: usize| w.mean[k] - best.mean[k];
        off(0).hypot(off(1)) > direction || off(2).hypot(off(3)) > position
    })
}
