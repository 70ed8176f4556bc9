//! The frames' common answer: solved together, each frame weighed by how well it agrees, until that stands.

use crate::fusion::agreement::{CONE, Distance, PLACE, by_kind, distance, redescending_weight};
use crate::fusion::earlier::Earlier;
use crate::fusion::heights::Heights;
use crate::fusion::placed::{Placed, Placing};
use crate::fusion::solve::{Solved, System};
use crate::fusion::start::{Ground, Start, fullest, spread};
use crate::fusion::sum::{Sum, counts, repeated, shown};
use crate::surface_fit::frame_factor::FrameFactor;
use crate::surface_fit::joint::form::Form;
use crate::surface_fit::joint::model::Inputs;
use crate::surface_fit::joint::parameters::{JointState, SIZE};
use nalgebra::DMatrix;

/// Most solutions with new weights; and with new equations, where valleys are bent.
const ROUNDS: usize = 12;
const BENT_ROUNDS: usize = 40;
/// A step of the pose this small is the last there, in standard deviations.
const SMALL_STEP: f64 = 1e-7;
/// So near to where the frames were placed no valley is bent, in standard deviations.
const STRAIGHT: f64 = 0.01;
/// Weights that change by less than this have settled.
const SETTLED: f64 = 1e-6;
/// Deviation at which a frame's cost is cut off.
const MAX_SIGMAS: f64 = 4.0;
/// Most by which the excess changes in one round.
const MOST_EXCESS: f64 = 1e6;
/// Standard deviation of the bias's bend from which on frames' valleys are bent, 1/m.
const BENT: f64 = 2e-3;

/// The frames' common answer.
#[derive(Debug, Clone)]
pub struct Common {
    /// The state about which the frames are placed.
    pub state: JointState,
    /// Its heights.
    pub heights: Heights,
    /// What was known before all frames.
    pub inputs: Inputs,
    /// The frames about the state.
    pub placed: Vec<Placed>,
    /// Their sum, as often as each counts.
    pub sum: Sum,
    /// Weight of every frame and of its cone, 0 to 1.
    pub weights: Vec<[f64; 2]>,
    /// Each frame's distance from the answer, as the equally rare deviation of a normal variable.
    pub deviations: Vec<f64>,
    /// Variance of the frames' scatter over what they state; at least 1.
    pub excess: f64,
    /// The most probable model, solved.
    pub best: Solved,
}

/// Fuses frames, and what stands before them; `None` where they tell no place.
pub fn fused(frames: &[FrameFactor], earlier: Option<&Earlier>) -> Option<Common> {
    let known = known_before(frames, earlier);
    let from = |start: Start| Rounds { frames, earlier, inputs: &known, form: &Form::default() }.run(start);
    let robust = match earlier {
        Some(earlier) if earlier.frames > frames.len() => from(earlier.start(frames)),
        _ => Rounds { frames, earlier, inputs: &known, form: &Form::default() }.majority().and_then(from),
    };
    // half of a few frames may agree by chance where each leaves much open: do all agree?
    match robust {
        Some(found) if found.weights.iter().all(|w| w[0] >= 0.5) => Some(found),
        Some(found) => {
            let other = if earlier.is_none() { from(everyone(frames, &Ground::of(frames))) } else { None };
            Some(other.into_iter().fold(found, |a, b| if b.cost() < a.cost() { b } else { a }))
        }
        None => None,
    }
}

impl Common {
    /// How often each share of each frame counts.
    pub fn counts(&self, earlier: Option<&Earlier>) -> Vec<[f64; 3]> {
        frame_counts(&self.placed, &self.weights, earlier)
    }

    /// How often each share of the earlier frames' sum counts.
    pub fn earlier_counts(&self, earlier: &Earlier) -> Vec<f64> {
        earlier_counts(&self.placed, &self.weights, earlier)
    }

    /// Sum of the squared deviations, of no frame more than `MAX_SIGMAS`, as if no frame scattered more than it states.
    fn cost(&self) -> f64 {
        let quadratic = self.sum.quadratic().times(self.excess);
        let form = Form::default();
        let system = System { quadratic: &quadratic, state: &self.state, inputs: &self.inputs, form: &form };
        let Some(plain) = system.covariance(self.best.model, &self.best.amplitudes) else { return f64::INFINITY };
        let off = |(frame, weights): (&Placed, &[f64; 2])| {
            let counted = by_kind(1.0, if weights[1] > 0.0 { 1.0 } else { 0.0 });
            distance(frame, &counted, &PLACE, (&plain, 1.0)).deviation().clamp(0.0, MAX_SIGMAS).powi(2)
        };
        self.placed.iter().zip(&self.weights).map(off).sum()
    }
}

/// How often each share of each frame counts.
fn frame_counts(placed: &[Placed], weights: &[[f64; 2]], earlier: Option<&Earlier>) -> Vec<[f64; 3]> {
    let agreeing: Vec<[f64; 3]> = weights.iter().map(|[frame, cone]| by_kind(*frame, *cone)).collect();
    repeated(placed, &agreeing, &earlier.map(Earlier::shown).unwrap_or_default())
}

/// How often each share of the earlier frames' sum counts: less, as others show the same.
fn earlier_counts(placed: &[Placed], weights: &[[f64; 2]], earlier: &Earlier) -> Vec<f64> {
    let agreeing: Vec<[f64; 3]> = weights.iter().map(|[frame, cone]| by_kind(*frame, *cone)).collect();
    let before = earlier.shown();
    let all = shown(placed, &agreeing, &before);
    before.iter().map(|one| counts(one, &all) / counts(one, &before)).collect()
}

#[derive(Clone, Copy)]
struct Rounds<'a> {
    frames: &'a [FrameFactor],
    earlier: Option<&'a Earlier>,
    inputs: &'a Inputs,
    form: &'a Form,
}

/// Frames that are compared with each other, and from how many of them the majority is looked for.
const COMPARED: usize = 24;
const CANDIDATES: usize = 8;
/// How often the closest half is fused again.
const CONCENTRATIONS: usize = 3;

/// All frames, from the fullest one.
fn everyone(frames: &[FrameFactor], ground: &Ground) -> Start {
    let (state, heights) = ground.at(frames, fullest(frames));
    let agreeing = ground.cones(frames).into_iter().map(|cone| [1.0, cone]).collect();
    Start { state, heights, agreeing }
}

impl Rounds<'_> {
    /// Least trimmed squares: the answer about which half of the frames lie closest.
    fn majority(&self) -> Option<Start> {
        let ground = Ground::of(self.frames);
        if self.frames.len() < 3 {
            return (!self.frames.is_empty()).then(|| everyone(self.frames, &ground));
        }
        let compared: Vec<FrameFactor> =
            spread(self.frames.len(), COMPARED).into_iter().map(|i| self.frames[i].clone()).collect();
        let some = Rounds { frames: &compared, earlier: None, ..*self };
        let tries = spread(compared.len(), CANDIDATES).into_iter();
        let placing = some.placing(&ground.heights);
        let (_, mut start) =
            tries.filter_map(|base| some.concentrated(&ground, &placing, base)).min_by(|a, b| a.0.total_cmp(&b.0))?;
        let cones = ground.cones(self.frames);
        let agreeing = std::mem::take(&mut start.agreeing);
        start.agreeing = cones.into_iter().map(|cone| [0.0, cone]).collect();
        for (i, weights) in spread(self.frames.len(), COMPARED).into_iter().zip(agreeing) {
            start.agreeing[i] = weights;
        }
        Some(start)
    }

    /// From a frame to the half that lies closest, with the sum of its distances.
    fn concentrated(&self, ground: &Ground, placing: &[Placing], base: usize) -> Option<(f64, Start)> {
        let (mut state, heights) = ground.at(self.frames, base);
        let cones = ground.cones(self.frames);
        let half = self.frames.len() / 2 + 1;
        let mut agreeing: Vec<[f64; 2]> = cones.iter().map(|cone| [0.0, *cone]).collect();
        agreeing[base][0] = 1.0;
        let mut cost = f64::INFINITY;
        let mut placed = about(placing, &state);
        for round in 0..CONCENTRATIONS {
            if round > 0 && self.is_bent() {
                placed = about(placing, &state);
            }
            let quadratic = self.sum(&placed, &agreeing, (&state, &heights), 1.0).quadratic();
            let system = System { quadratic: &quadratic, state: &state, inputs: self.inputs, form: self.form };
            let found = system.solved(system.widest())?;
            let step: [f64; SIZE] = std::array::from_fn(|k| found.state.x[k] - state.x[k]);
            placed.iter_mut().for_each(|frame| frame.shift(&step));
            let off = |(frame, cone): (&Placed, &f64)| {
                distance(frame, &by_kind(1.0, *cone), &PLACE, (&found.covariance, 1.0))
            };
            let distances: Vec<Distance> = placed.iter().zip(&cones).map(off).collect();
            let told = |d: &Distance| if d.dof < 4 { f64::INFINITY } else { d.squared / d.dof as f64 };
            let mut order: Vec<usize> = (0..distances.len()).collect();
            order.sort_by(|&a, &b| told(&distances[a]).total_cmp(&told(&distances[b])));
            cost = order[..half].iter().map(|&i| told(&distances[i])).sum();
            agreeing.iter_mut().for_each(|weights| weights[0] = 0.0);
            order[..half].iter().filter(|&&i| distances[i].dof >= 4).for_each(|&i| agreeing[i][0] = 1.0);
            state = found.state;
        }
        Some((cost, Start { state, heights, agreeing }))
    }

    fn run(&self, start: Start) -> Option<Common> {
        let Start { mut state, heights, agreeing: mut weights } = start;
        let placing = self.placing(&heights);
        let (mut placed, mut at) = (about(&placing, &state), state.x);
        let mut excess = 1.0;
        let mut found: Option<(Solved, Vec<f64>)> = None;
        let bent = self.is_bent();
        for round in 0..if bent { BENT_ROUNDS } else { ROUNDS } {
            let sum = self.sum(&placed, &weights, (&state, &heights), excess);
            let quadratic = sum.quadratic();
            let system = System { quadratic: &quadratic, state: &state, inputs: self.inputs, form: self.form };
            // the models are weighed where the weights are new; between, the best one is solved again
            let same = found.as_ref().filter(|_| round > 1).and_then(|(best, _)| system.solved(best.model));
            let best = same.or_else(|| system.models().into_iter().next())?;
            let step: [f64; SIZE] = std::array::from_fn(|k| best.state.x[k] - state.x[k]);
            state = best.state.clone();
            let std = |k: usize| best.covariance[(k, k)].sqrt();
            let away = || (0..SIZE).any(|k| (state.x[k] - at[k]).abs() > STRAIGHT * std(k));
            if round == 0 || bent && away() {
                (placed, at) = (about(&placing, &state), state.x);
            } else {
                placed.iter_mut().for_each(|frame| frame.shift(&step));
            }
            let distances = self.distances(&placed, (&best.covariance, excess));
            let more = scatter(&distances, &weights).clamp(1.0 / excess, MOST_EXCESS);
            let new: Vec<[f64; 2]> = distances.iter().map(|d| weighed(d, more)).collect();
            let change = new.iter().zip(&weights).map(|(a, b)| (a[0] - b[0]).abs().max((a[1] - b[1]).abs()));
            let settled = change.fold(0.0, f64::max) < SETTLED;
            let next = excess * more;
            let calm = (next / excess - 1.0).abs() < 0.01;
            let small = |k: usize| step[k].abs() < SMALL_STEP * std(k);
            let still = !bent || (0..4).all(small);
            found = Some((best, distances.iter().map(|[place, _]| place.over(more).deviation()).collect()));
            if settled && calm && still && round > 0 {
                break;
            }
            (weights, excess) = (new, next);
        }
        let (best, deviations) = found?;
        let sum = self.sum(&placed, &weights, (&state, &heights), excess);
        let inputs = self.inputs.clone();
        Some(Common { state, heights, inputs, placed, sum, weights, deviations, excess, best })
    }

    /// Whether the frames' valleys are bent, so that their equations are made anew where the answer moves.
    fn is_bent(&self) -> bool {
        self.inputs.bias_std[2] > BENT
    }

    fn placing(&self, heights: &Heights) -> Vec<Placing<'_>> {
        self.frames.iter().map(|frame| Placing::of(frame, heights)).collect()
    }

    /// The frames added up, each as often as it counts, and what stands before them.
    fn sum(&self, placed: &[Placed], weights: &[[f64; 2]], at: (&JointState, &Heights), excess: f64) -> Sum {
        let mut sum = Sum::default();
        for (frame, times) in placed.iter().zip(frame_counts(placed, weights, self.earlier)) {
            frame.shares.iter().for_each(|share| sum.add(share, times[share.kind as usize] / excess));
        }
        if let Some(earlier) = self.earlier {
            let times = earlier_counts(placed, weights, earlier);
            earlier.placed(at).shares.iter().zip(times).for_each(|(share, times)| sum.add(share, times / excess));
        }
        sum
    }

    /// Distances of the frames from an answer, and of their cones.
    fn distances(&self, placed: &[Placed], answer: (&DMatrix<f64>, f64)) -> Vec<[Distance; 2]> {
        let one = |frame: &Placed| {
            let cone = distance(frame, &[0.0, 1.0, 0.0], &CONE, answer);
            let same = if redescending_weight(cone.deviation()) > 0.0 { 1.0 } else { 0.0 };
            [distance(frame, &by_kind(1.0, same), &PLACE, answer), cone]
        };
        placed.iter().map(one).collect()
    }
}

/// Frames about a state.
fn about(frames: &[Placing], state: &JointState) -> Vec<Placed> {
    frames.iter().map(|frame| frame.about(state)).collect()
}

/// Weights of a frame and of its cone by how well they agree, where frames scatter so many times more than was stated.
fn weighed([place, cone]: &[Distance; 2], more: f64) -> [f64; 2] {
    let told = if place.dof < 4 { 0.0 } else { redescending_weight(place.over(more).deviation()) };
    [told, redescending_weight(cone.over(more).deviation())]
}

/// Median of the counted frames' squared distances over the median that chi-square has; 1 for a single frame.
fn scatter(distances: &[[Distance; 2]], weights: &[[f64; 2]]) -> f64 {
    let counted = distances.iter().zip(weights).filter(|(d, w)| w[0] > 0.0 && d[0].dof >= 4);
    let mut ratios: Vec<f64> = counted.map(|(d, _)| d[0].over_median()).collect();
    if ratios.len() < 2 {
        return 1.0;
    }
    ratios.sort_by(f64::total_cmp);
    let middle = ratios.len() / 2;
    if ratios.len() % 2 == 1 { ratios[middle] } else { 0.5 * (ratios[middle - 1] + ratios[middle]) }
}

/// What was known before: the bias, the diameter and the intrinsics once, each frame's own gravity averaged.
fn known_before(frames: &[FrameFactor], earlier: Option<&Earlier>) -> Inputs {
    let all = frames.iter().map(|frame| &frame.known).chain(earlier.map(|e| &e.factor.known));
    let mut known: Option<Inputs> = None;
    let (mut turns, mut count) = ([0.0; 2], 0.0);
    for one in all {
        if let Some((pose, _)) = one.gravity {
            (turns[0], turns[1], count) = (turns[0] + pose.r_x, turns[1] + pose.r_y, count + 1.0);
        }
        let so_far = known.get_or_insert_with(|| one.clone());
        (0..3).for_each(|k| so_far.bias_std[k] = so_far.bias_std[k].max(one.bias_std[k]));
        (0..5).for_each(|k| so_far.camera_std[k] = so_far.camera_std[k].max(one.camera_std[k]));
        so_far.radius = so_far.radius.or(one.radius);
        so_far.gravity = so_far.gravity.or(one.gravity);
    }
    let mut known = known.unwrap_or(Inputs {
        bias: Default::default(),
        bias_std: [0.0; 3],
        radius: None,
        gravity: None,
        camera_std: [0.0; 5],
    });
    if let Some((pose, _)) = &mut known.gravity {
        (pose.r_x, pose.r_y) = (turns[0] / count, turns[1] / count);
    }
    known
}
