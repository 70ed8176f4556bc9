//! Has the camera moved? A robust search for the place, and a test that shares all but the pose.

use crate::fusion::agreement::{by_kind, rows_of};
use crate::fusion::common::{Common, fused};
use crate::fusion::contrast::{MOVING, contrast};
use crate::fusion::earlier::Earlier;
use crate::fusion::heights::Heights;
use crate::fusion::placed::{Placed, Placing};
use crate::fusion::solve::System;
use crate::fusion::sum::{Sum, repeated};
use crate::surface_fit::frame_factor::FrameFactor;
use crate::surface_fit::joint::form::Form;
use crate::surface_fit::joint::parameters::JointState;
use nalgebra::Vector4;

/// A move of the camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Move {
    /// The first frame after it.
    pub index: usize,
    /// Angle between the axis directions, rad.
    pub turn: f64,
    /// Change of (t_x, t_y), metres.
    pub shift: f64,
    /// Squared distance of the step from none, for 4 degrees of freedom.
    pub significance: f64,
}

/// A move needs this many agreeing frames on both sides; fewer are bad frames.
pub const MIN_FRAMES: usize = 3;
/// Least squared distance of the step from none (chance: 4e-10).
const CHI2_MOVE: f64 = 50.0;
/// Smallest reported turn, rad, and shift, metres.
const MIN_TURN: f64 = 5e-4;
const MIN_SHIFT: f64 = 1e-3;
/// Deviation at which a frame's misfit about its side's place is cut off.
const MAX_SIGMAS: f64 = 4.0;
/// Smallest scatter between neighbours, rad and metres.
const SMALLEST: [f64; 4] = [2e-5, 2e-5, 5e-5, 5e-5];

/// All moves in the sequence, in order; `earlier` frames stand before it, `all` is the answer of all of them.
pub fn find_moves(frames: &[FrameFactor], earlier: Option<&Earlier>, all: &Common, first: usize) -> Vec<Move> {
    let known = earlier.map_or(0, |e| e.frames);
    if frames.len() < MIN_FRAMES || known + frames.len() < 2 * MIN_FRAMES {
        return Vec::new();
    }
    let least = if known < MIN_FRAMES { MIN_FRAMES } else { 0 };
    let places = frame_places(all);
    let anchor = earlier.and_then(|earlier| {
        let frame = earlier.placed((&all.state, &all.heights));
        Some((place_of(&frame, &[1.0; 3])?, earlier.frames.min(2 * frames.len())))
    });
    let Some(split) = best_split(&places, anchor, least) else { return Vec::new() };
    let known_place = anchor.map(|((step, _), _)| step);
    let Some((found, before, after)) = judged(frames, earlier, all, (split, &places, known_place)) else {
        return Vec::new();
    };
    let place = found.index;
    let again = |side: Option<Common>, frames: &[FrameFactor], earlier: Option<&Earlier>| {
        side.filter(|side| side.placed.len() == frames.len()).or_else(|| fused(frames, earlier))
    };
    let (old, new) = frames.split_at(place);
    let mut moves = Vec::new();
    if let Some(before) = again(before, old, earlier).filter(|_| !old.is_empty()) {
        moves.extend(find_moves(old, earlier, &before, first));
    }
    moves.push(Move { index: first + place, ..found });
    if let Some(after) = again(Some(after), new, None) {
        moves.extend(find_moves(new, None, &after, first + place));
    }
    moves
}

/// Each frame's own step of the pose from the common answer, and its standard deviations; `None` where it tells none.
fn frame_places(all: &Common) -> Vec<Option<OwnPlace>> {
    let one = |(frame, weights): (&Placed, &[f64; 2])| {
        place_of(frame, &by_kind(1.0, if weights[1] > 0.0 { 1.0 } else { 0.0 }))
    };
    all.placed.iter().zip(&all.weights).map(one).collect()
}

/// A step of the pose and its standard deviations.
type OwnPlace = (Vector4<f64>, Vector4<f64>);

fn place_of(frame: &Placed, counted: &[f64; 3]) -> Option<OwnPlace> {
    let (information, gradient) = rows_of(frame, counted, &[0, 1, 2, 3]);
    let own = nalgebra::Matrix4::from_fn(|r, c| information[(r, c)]);
    let inverse = own.cholesky()?.inverse();
    let step = -(inverse * Vector4::from_fn(|k, _| gradient[k]));
    step.iter().all(|v| v.is_finite()).then(|| (step, inverse.diagonal().map(f64::sqrt)))
}

/// Where cutting the sequence in two leaves the smallest robust misfit of the frames' places.
///
/// An `anchor` is the place of frames that stand before the sequence, and how many of them count.
fn best_split(places: &[Option<OwnPlace>], anchor: Option<(OwnPlace, usize)>, least: usize) -> Option<usize> {
    let known: Vec<(usize, Vector4<f64>, Vector4<f64>)> =
        places.iter().enumerate().filter_map(|(i, p)| p.map(|(step, std)| (i, step, std))).collect();
    let between = neighbours(&known);
    let told = |(step, std): OwnPlace| std::array::from_fn(|k| (step[k], between[k].hypot(std[k])));
    let before = anchor.map_or_else(Vec::new, |(place, count)| vec![told(place); count]);
    let own = known.iter().map(|(_, step, std)| told((*step, *std)));
    let all: Vec<Told> = before.iter().copied().chain(own).collect();
    let end = places.len().checked_sub(MIN_FRAMES).filter(|end| *end >= least)?;
    let cost = |split: usize| {
        let at = before.len() + known.partition_point(|(i, _, _)| *i < split);
        misfit(&all[..at]) + misfit(&all[at..])
    };
    let mut range = (least, end);
    loop {
        let step = (range.1 - range.0).div_ceil(16).max(1);
        let places = (range.0..=range.1).step_by(step).chain([range.1]);
        let best = places.map(|split| (cost(split), split)).min_by(|a, b| a.0.total_cmp(&b.0))?.1;
        if step == 1 {
            return Some(best);
        }
        range = (best.saturating_sub(step).max(least), (best + step).min(end));
    }
}

/// How much the places of neighbours scatter.
fn neighbours(known: &[(usize, Vector4<f64>, Vector4<f64>)]) -> [f64; 4] {
    std::array::from_fn(|k| {
        let steps = known.windows(2).map(|pair| (pair[1].1[k] - pair[0].1[k]).abs());
        (1.4826 * median(steps.collect()) / std::f64::consts::SQRT_2).max(SMALLEST[k])
    })
}

/// The pose's four steps, each with the deviation that it may have by chance.
type Told = [(f64, f64); 4];

/// Squared deviations from their weighted median, cut off.
fn misfit(places: &[Told]) -> f64 {
    let middle: [f64; 4] = std::array::from_fn(|k| weighted_median(places.iter().map(|p| p[k]).collect()));
    let off = |p: &Told| (0..4).map(|k| ((p[k].0 - middle[k]) / p[k].1).powi(2)).sum::<f64>();
    places.iter().map(|p| off(p).min(4.0 * MAX_SIGMAS * MAX_SIGMAS)).sum()
}

/// The value from which the others differ least, each in its own deviation.
fn weighted_median(mut values: Vec<(f64, f64)>) -> f64 {
    values.sort_by(|a, b| a.0.total_cmp(&b.0));
    let half = 0.5 * values.iter().map(|(_, std)| 1.0 / std).sum::<f64>();
    let mut so_far = 0.0;
    let reached = |(_, std): &&(f64, f64)| {
        so_far += 1.0 / std;
        so_far >= half
    };
    values.iter().find(reached).map_or(0.0, |(value, _)| *value)
}

fn median(mut values: Vec<f64>) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

type Judged = (Move, Option<Common>, Common);

/// The move at a place, if both sides agree within themselves and not with each other; and the sides' answers.
fn judged(
    frames: &[FrameFactor],
    earlier: Option<&Earlier>,
    all: &Common,
    (split, places, known_place): (usize, &[Option<OwnPlace>], Option<Vector4<f64>>),
) -> Option<Judged> {
    let before = if split > 0 { Some(fused(&frames[..split], earlier)?) } else { None };
    let after = fused(&frames[split..], None)?;
    let agreeing = |side: &Common| side.weights.iter().filter(|w| w[0] > 0.5).count();
    let known = earlier.map_or(0, |e| e.frames);
    if known + before.as_ref().map_or(0, agreeing) < MIN_FRAMES || agreeing(&after) < MIN_FRAMES {
        return None;
    }
    let found = step_between(frames, (all, earlier), split, (before.as_ref(), &after))?;
    let (turn, shift) = (found.0[0].hypot(found.0[1]), found.0[2].hypot(found.0[3]));
    let worth = turn > MIN_TURN || shift > MIN_SHIFT;
    let index = placed_beside(split, places, (before.as_ref(), &after), known_place);
    (worth && found.1 > CHI2_MOVE).then_some((Move { index, turn, shift, significance: found.1 }, before, after))
}

/// A step larger than this, in radians or radii, is that between the sides' own answers: equations don't reach so far.
const NEAR: f64 = 0.03;
/// A step of the sides' poses this small is the last, rad and metres.
const SMALL_STEP: f64 = 1e-5;
/// How often the sides' equations are made anew where their poses are.
const ROUNDS: usize = 8;

/// The step of the camera and the cone's intercept between two sides, and the squared distance of the pose's from none.
fn step_between(
    frames: &[FrameFactor],
    (all, earlier): (&Common, Option<&Earlier>),
    split: usize,
    (before, after): (Option<&Common>, &Common),
) -> Option<([f64; 5], f64)> {
    let place = |state: &JointState| MOVING.map(|k| state.x[k]);
    let first = before.map_or_else(|| earlier.map(|e| place(&e.factor.state)), |b| Some(place(&b.state)))?;
    let mut states = [first, place(&after.state)].map(|place| {
        let mut state = all.state.clone();
        MOVING.into_iter().zip(place).take(4).for_each(|(k, value)| state.x[k] = value);
        state
    });
    let form = Form::default();
    let apart = MOVING.map(|k| after.state.x[k] - before.map_or(states[0].x[k], |b| b.state.x[k]));
    let mut found = None;
    let frames: Vec<Placing> = frames.iter().map(|frame| Placing::of(frame, &all.heights)).collect();
    for _ in 0..ROUNDS {
        let one = side(&frames[..split], before, earlier, (&states[0], &all.heights));
        let other = side(&frames[split..], Some(after), None, (&states[1], &all.heights));
        let [one, other] = [one, other].map(|sum| sum.quadratic());
        let system = System { quadratic: &one, state: &states[0], inputs: &all.inputs, form: &form };
        let prior = system.prior(all.best.model, &all.best.amplitudes);
        let so_far = MOVING.map(|k| states[1].x[k] - states[0].x[k]);
        let step = contrast([&one, &other], (&states[0].x, &so_far), &prior)?;
        states.iter_mut().for_each(|state| state.add(&step.common, 1.0));
        MOVING.into_iter().zip(step.step).for_each(|(k, step)| states[1].x[k] += step);
        found = Some((apart, step.squared));
        let size = all.state.size();
        let near = apart[..2].iter().all(|turn| turn.abs() < NEAR) && apart[2..4].iter().all(|t| t.abs() < NEAR * size);
        if near && step.step[..4].iter().chain(&step.common[..4]).all(|s| s.abs() < SMALL_STEP) {
            return Some((MOVING.map(|k| states[1].x[k] - states[0].x[k]), step.squared));
        }
    }
    found
}

/// A side's frames about a state, as often as each counts on its side.
fn side(frames: &[Placing], own: Option<&Common>, earlier: Option<&Earlier>, at: (&JointState, &Heights)) -> Sum {
    let mut sum = Sum::default();
    if let Some(own) = own {
        let placed: Vec<Placed> = frames.iter().map(|frame| frame.about(at.0)).collect();
        let agreeing: Vec<[f64; 3]> = own.weights.iter().map(|[frame, cone]| by_kind(*frame, *cone)).collect();
        for (frame, times) in placed.iter().zip(repeated(&placed, &agreeing, &[])) {
            frame.shares.iter().for_each(|share| sum.add(share, times[share.kind as usize] / own.excess));
        }
    }
    if let Some(earlier) = earlier {
        earlier.placed(at).shares.iter().for_each(|share| sum.add(share, 1.0));
    }
    sum
}

/// The place, with bad frames beside it on the side whose pose is nearer: they cost the same on both.
///
/// Where no frame before the place is good, their side is where the frames before the sequence are, at `known_place`.
fn placed_beside(
    mut split: usize,
    places: &[Option<OwnPlace>],
    (before, after): (Option<&Common>, &Common),
    known_place: Option<Vector4<f64>>,
) -> usize {
    let Some(before) = before else { return split };
    let first = split;
    let bad = |i: usize| if i < first { before.weights[i][0] < 0.5 } else { after.weights[i - first][0] < 0.5 };
    let middle = |range: std::ops::Range<usize>| {
        let good = |i: &usize| !bad(*i);
        Vector4::from_fn(|k, _| median(range.clone().filter(good).filter_map(|i| places[i].map(|p| p.0[k])).collect()))
    };
    let old = known_place.filter(|_| (0..first).all(bad)).unwrap_or_else(|| middle(0..first));
    let new = middle(first..places.len());
    let off = |i: usize, from: &Vector4<f64>| {
        places[i].map_or(0.0, |(step, std)| (step - from).component_div(&std).norm_squared())
    };
    while split > 0 && bad(split - 1) && off(split - 1, &new) < off(split - 1, &old) {
        split -= 1;
    }
    while split < places.len() && bad(split) && off(split, &old) < off(split, &new) {
        split += 1;
    }
    split
}
