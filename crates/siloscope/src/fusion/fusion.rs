//! The frames fused: their answer since the last move of the camera, and what each of them had to do with it.

use crate::fusion::common::{Common, fused};
use crate::fusion::earlier::Earlier;
use crate::fusion::moves::{Move, find_moves};
use crate::fusion::solve::{System, probabilities};
use crate::fusion::sum::Sum;
use crate::surface_fit::frame_factor::{FrameFactor, Kind};
use crate::surface_fit::joint::answer::coaxial;
use crate::surface_fit::joint::average::Average;
use crate::surface_fit::joint::form::Form;
use crate::surface_fit::joint::model::{HOPPER_SLOPE, Model};
use crate::surface_fit::joint::parameters::{CAMERA, SLOPE};

pub use crate::surface_fit::joint::answer::Coaxial;

/// What frames say together.
#[derive(Debug, Clone)]
pub struct Fusion {
    /// Moves of the camera, in order; the answer is that of the frames from the last one on.
    pub moves: Vec<Move>,
    /// The answer in the twelve parameters; its covariance contains that of the scale. It has every cone about the axis.
    pub answer: Coaxial,
    /// Whether the cone is known to be the silo's own, and no surface of feed.
    pub hopper: bool,
    /// The models with their probabilities, most probable first.
    pub models: Vec<(Model, f64)>,
    /// Errors of the intrinsics: focal lengths (relative), principal point (rays), k1.
    pub camera: [f64; 5],
    /// Whether the form is none of a wall: an amplitude is at its cap.
    pub deformed: bool,
    /// Standard deviation of a depth scale that nothing tells.
    pub scale_std: f64,
    /// The common answer.
    pub common: Common,
    /// Number of the first frame that is part of it.
    pub first: usize,
}

/// Fuses frames with those before them; `None` where they tell no place.
pub fn fuse(frames: &[FrameFactor], earlier: Option<&Earlier>) -> Option<Fusion> {
    let all = fused(frames, earlier)?;
    let moves = find_moves(frames, earlier, &all, 0);
    let first = moves.last().map_or(0, |last| last.index);
    let earlier = if moves.is_empty() { earlier } else { None };
    let common = if moves.is_empty() { all } else { fused(&frames[first..], None)? };
    let Told { answer, hopper, models, camera, deformed } = told(&frames[first..], earlier, &common)?;
    let scales = frames[first..].iter().map(|frame| frame.scale_std).chain(earlier.map(|e| e.factor.scale_std));
    let scale_std = scales.fold(0.0, f64::max);
    let answer = answer.with_scale(scale_std);
    Some(Fusion { moves, answer, hopper, models, camera, deformed, scale_std, common, first })
}

/// What the common answer says, as `Fusion` has it.
struct Told {
    answer: Coaxial,
    hopper: bool,
    models: Vec<(Model, f64)>,
    camera: [f64; 5],
    deformed: bool,
}

fn told(frames: &[FrameFactor], earlier: Option<&Earlier>, common: &Common) -> Option<Told> {
    let (quadratic, form) = (common.sum.quadratic(), Form::default());
    let system = System { quadratic: &quadratic, state: &common.state, inputs: &common.inputs, form: &form };
    let models = system.models();
    let weighed: Vec<_> = models.iter().zip(probabilities(&models)).collect();
    let average = system.averaged(&weighed, common.heights.form, false)?;
    let exact = common.inputs.camera_std == [0.0; 5];
    let relative = if exact { average.clone() } else { system.averaged(&weighed, common.heights.form, true)? };
    let best = models.first()?;
    let cone = matches!(best.model, Model::CoaxialCone | Model::ConeAlone);
    let hopper = best.model == Model::ConeAlone || cone && is_hopper(frames, earlier, common, &average);
    let answer = coaxial(&common.state, (&average.mean, &average.covariance), &relative.covariance, cone);
    let camera = std::array::from_fn(|k| average.mean[CAMERA + k]);
    let told = weighed.iter().map(|(solved, p)| (solved.model, *p)).collect();
    let deformed = best.amplitudes.at_cap(common.state.size()).is_some();
    Some(Told { answer, hopper, models: told, camera, deformed })
}

/// Whether the common cone is the silo's own: steeper than feed lies, or a frame has seen feed in it.
fn is_hopper(frames: &[FrameFactor], earlier: Option<&Earlier>, common: &Common, average: &Average) -> bool {
    let steep = average.mean[SLOPE] < HOPPER_SLOPE;
    let counted = frames.iter().zip(&common.weights).filter(|(_, w)| w[0] * w[1] > 0.5);
    steep || counted.map(|(frame, _)| frame.hopper).chain(earlier.map(|e| e.factor.hopper)).any(|hopper| hopper)
}

impl Fusion {
    /// Some of the first frames of the answer added up, with what stands before them, for a later continuation.
    pub fn added_up(&self, frames: &[FrameFactor], count: usize, earlier: Option<&Earlier>) -> Option<Earlier> {
        let earlier = earlier.filter(|_| self.moves.is_empty());
        let frames = frames.get(self.first..self.first + count)?;
        let common = &self.common;
        let mut sum = Sum::default();
        let weights = common.weights.get(..count)?;
        let times = common.counts(earlier);
        let (mut counted, mut means) = ([0.0; 3], [[0.0; 2]; 3]);
        let mut note = |kind: Kind, weight: f64, values: [f64; 2]| {
            counted[kind as usize] += weight;
            (0..2).for_each(|k| means[kind as usize][k] += weight * values[k]);
        };
        for ((placed, times), [frame, cone]) in common.placed.iter().zip(&times).zip(weights) {
            for share in &placed.shares {
                sum.add(share, times[share.kind as usize]);
                let weight = if share.kind == Kind::Cone { frame * cone } else { *frame };
                note(share.kind, weight, [share.sensor_fraction, share.seen]);
            }
        }
        if let Some(earlier) = earlier {
            let scale = common.earlier_counts(earlier);
            let placed = earlier.placed((&common.state, &common.heights));
            for ((share, frames), scale) in placed.shares.iter().zip(&earlier.counted).zip(scale) {
                sum.add(share, scale);
                note(share.kind, *frames, [share.sensor_fraction, share.seen]);
            }
        }
        for share in &mut sum.shares {
            let n = counted[share.kind as usize].max(1e-9);
            let [fraction, seen] = means[share.kind as usize].map(|sum| sum / n);
            (share.sensor_fraction, share.seen) = (fraction, seen);
        }
        let hoppers = frames.iter().zip(weights).filter(|(_, w)| w[0] * w[1] > 0.5).any(|(frame, _)| frame.hopper);
        let counted = sum.shares.iter().map(|share| counted[share.kind as usize]).collect();
        let factor = FrameFactor {
            state: common.state.clone(),
            model: common.best.model,
            hopper: hoppers || earlier.is_some_and(|e| e.factor.hopper),
            shares: sum.shares,
            known: common.inputs.clone(),
            scale_std: self.scale_std,
            rays: Vec::new(),
        };
        let frames = count + earlier.map_or(0, |e| e.frames);
        Some(Earlier { factor, heights: common.heights, counted, frames })
    }
}
