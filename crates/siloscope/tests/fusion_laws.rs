//! Laws of the fusion, on frames whose readings are those of a known vessel.

use siloscope::fusion::earlier::Earlier;
use siloscope::fusion::fusion::{Fusion, fuse};
use siloscope::geometry::sensor::DepthBias;
use siloscope::geometry::surface::Part;
use siloscope::surface_fit::frame_factor::{FrameFactor, Kind, Share};
use siloscope::surface_fit::joint::form::Form;
use siloscope::surface_fit::joint::model::{Inputs, Model};
use siloscope::surface_fit::joint::parameters::{INTERCEPT, JointState, RADIUS, SIZE, SLOPE};
use siloscope::surface_fit::joint::predict::{Predictor, Sight};
use siloscope::surface_fit::joint::system::Accumulator;

/// Noise of a tile, metres.
const NOISE: f64 = 1e-3;
const CAMERA_STD: [f64; 5] = [0.002, 0.002, 0.0018, 0.0018, 0.003];

/// A hopper seen from above: pose, radius, slope and intercept.
fn silo(pose: [f64; 4], slope: f64, intercept: f64) -> JointState {
    let mut x = [0.0; SIZE];
    x[..4].copy_from_slice(&pose);
    (x[RADIUS], x[SLOPE], x[INTERCEPT]) = (1.25, slope, intercept);
    let mut state = JointState { x, has_cylinder: true, has_cone: true, reference: 1.0 };
    state.reference = state.joint();
    state
}

const POSE: [f64; 4] = [0.08, -0.05, 0.2, -0.1];

fn hopper(pose: [f64; 4]) -> JointState {
    silo(pose, 0.6, 3.2)
}

/// A number between −1 and 1 that looks like chance.
fn chance(seed: usize, k: usize) -> f64 {
    ((seed as f64 * 12.9898 + k as f64 * 78.233).sin() * 43758.5453).fract()
}

/// Place of the wall on a ray, and its residual against a reading.
fn sight(predictor: &Predictor, ray: [f64; 2], reading: Option<f64>) -> Option<(Sight, f64)> {
    let turned = predictor.caster.turn(predictor.state.corrected(ray));
    let (depth, part) = predictor.caster.depth(&turned, [0.0; 2]);
    let at = predictor.caster.incidence(&turned, depth, part);
    let told = predictor.state.bias().measured(depth);
    let found = Sight {
        residual: reading.map_or(0.0, |r| r - told),
        depth,
        at,
        rate: at.along / predictor.state.bias().slope(depth),
        angle2: 0.0,
        ray,
        bend: None,
    };
    (depth.is_finite() && at.along > 0.05).then_some((found, told))
}

/// What a frame of a vessel says, its equations made at `from`; feed hides what lies below `level`.
fn frame(truth: &JointState, from: &JointState, level: f64, seed: usize) -> FrameFactor {
    let form = Form::default();
    let (real, guess) = (Predictor::new(truth, &form), Predictor::new(from, &form));
    let (mut sums, mut row, mut seen) = (Accumulator::default(), [0.0; SIZE], [0.0; 2]);
    for k in 0..600 {
        let ray = [0.6 * ((k % 30) as f64 / 14.5 - 1.0), 0.45 * ((k / 30) as f64 / 9.5 - 1.0)];
        let Some((there, reading)) = sight(&real, ray, None) else { continue };
        let Some((found, _)) = sight(&guess, ray, Some(reading + 1.7 * NOISE * chance(seed, k))) else { continue };
        let near_joint = (found.at.z - from.joint()).abs() < 0.15;
        if there.at.z > level || found.at.part != there.at.part || near_joint {
            continue;
        }
        let width = guess.derivative(&found, true, &mut row);
        sums.add(found.at.part, &row[..width], found.residual, NOISE.powi(-2));
        seen[usize::from(found.at.part == Part::Cone)] += 1.0 / 600.0;
    }
    let parts = sums.quadratic().parts;
    let share = |(kind, (part, seen)): (Kind, (siloscope::surface_fit::joint::system::PartSum, f64))| {
        (seen > 0.0).then_some(Share {
            kind,
            information: part.information,
            gradient: part.gradient,
            sensor_fraction: 0.5,
            seen,
        })
    };
    let has_cone = seen[1] > 0.0;
    FrameFactor {
        state: JointState { has_cone, ..from.clone() },
        model: if has_cone { Model::CoaxialCone } else { Model::Cylinder },
        hopper: has_cone,
        shares: [Kind::Cylinder, Kind::Cone].into_iter().zip(parts.into_iter().zip(seen)).filter_map(share).collect(),
        known: Inputs {
            bias: DepthBias::default(),
            bias_std: [5e-4, 5e-4, 3e-4],
            radius: None,
            gravity: None,
            camera_std: CAMERA_STD,
        },
        scale_std: 0.0,
        rays: Vec::new(),
    }
}

/// Frames of a hopper that is emptied.
fn discharge(pose: [f64; 4], count: usize, seed: usize) -> Vec<FrameFactor> {
    let level = |k: usize| 2.2 + 2.6 * k as f64 / count as f64;
    (0..count).map(|k| frame(&hopper(pose), &hopper(pose), level(k), seed + k)).collect()
}

fn fused(frames: &[FrameFactor], earlier: Option<&Earlier>) -> Fusion {
    fuse(frames, earlier).unwrap_or_else(|| unreachable!("the frames tell a place"))
}

fn stds(fusion: &Fusion) -> [f64; 4] {
    std::array::from_fn(|k| fusion.answer.covariance[(k, k)].sqrt())
}

/// Largest difference of two poses in standard deviations, and of these, relative.
fn apart(one: &Fusion, other: &Fusion) -> [f64; 2] {
    let (a, b) = (stds(one), stds(other));
    let off = |k: usize| (one.answer.parameters[k] - other.answer.parameters[k]).abs() / a[k];
    [(0..4).map(off).fold(0.0, f64::max), (0..4).map(|k| (b[k] / a[k] - 1.0).abs()).fold(0.0, f64::max)]
}

#[test]
fn the_answer_is_within_its_deviations() {
    let fusion = fused(&discharge(POSE, 10, 3), None);
    let std = stds(&fusion);
    for k in 0..4 {
        assert!((fusion.answer.parameters[k] - POSE[k]).abs() < 3.0 * std[k], "{k}: {:?}", fusion.answer.parameters);
    }
    assert_eq!(fusion.models[0].0, Model::CoaxialCone);
    assert!(fusion.moves.is_empty() && fusion.common.weights.iter().all(|w| w[0] == 1.0));
}

#[test]
fn the_order_of_the_frames_does_not_matter() {
    let mut frames = discharge(POSE, 9, 5);
    let one = fused(&frames, None);
    frames.reverse();
    frames.swap(1, 5);
    let [off, wider] = apart(&one, &fused(&frames, None));
    assert!(off < 1e-5 && wider < 1e-5, "{off} {wider}");
}

#[test]
fn frames_added_up_say_what_they_said_one_by_one() {
    let frames = discharge(POSE, 12, 11);
    let at_once = fused(&frames, None);
    let first = fused(&frames[..7], None);
    let earlier = first.added_up(&frames[..7], 7, None).expect("seven frames");
    let [off, wider] = apart(&at_once, &fused(&frames[7..], Some(&earlier)));
    assert!(off < 0.1 && wider < 0.1, "{off} {wider}");
    assert_eq!(earlier.frames, 7);
}

#[test]
fn what_all_frames_share_does_not_shrink_with_their_number() {
    // the readings of these frames have noise alone, which is new in every one of them
    let [few, many] = [4, 40].map(|count| {
        let mut frames = discharge(POSE, count, 21);
        frames.iter_mut().flat_map(|frame| &mut frame.shares).for_each(|share| share.sensor_fraction = 1.0);
        fused(&frames, None)
    });
    let (some, all) = (stds(&few), stds(&many));
    assert!(all[0] > 0.6 * some[0] && all[0] > 0.5 * CAMERA_STD[3], "{some:?} {all:?}");
    let relative = |fusion: &Fusion| fusion.answer.relative[(0, 0)].sqrt();
    assert!(relative(&many) < 0.9 * relative(&few));
}

#[test]
fn the_same_frame_without_noise_counts_once() {
    let mut one = frame(&hopper(POSE), &hopper(POSE), 4.0, 1);
    one.shares.iter_mut().for_each(|share| share.sensor_fraction = 0.0);
    let [off, wider] = apart(&fused(std::slice::from_ref(&one), None), &fused(&vec![one; 15], None));
    assert!(off < 1e-6 && wider < 1e-6, "{off} {wider}");
}

#[test]
fn equations_made_beside_the_answer_say_the_same() {
    let beside = hopper([POSE[0] + 1e-3, POSE[1], POSE[2] - 2e-3, POSE[3]]);
    let there = |from: &JointState| (0..6).map(|k| frame(&hopper(POSE), from, 2.6 + 0.4 * k as f64, k)).collect();
    let [one, other]: [Vec<FrameFactor>; 2] = [there(&hopper(POSE)), there(&beside)];
    let [off, wider] = apart(&fused(&one, None), &fused(&other, None));
    assert!(off < 0.05 && wider < 0.05, "{off} {wider}");
}

#[test]
fn a_frame_of_another_place_is_left_out() {
    let mut frames = discharge(POSE, 9, 31);
    let clean = fused(&frames, None);
    let elsewhere = hopper([POSE[0] + 0.01, POSE[1], POSE[2] + 0.02, POSE[3]]);
    frames.insert(4, frame(&elsewhere, &elsewhere, 3.5, 77));
    let found = fused(&frames, None);
    assert_eq!(found.common.weights.iter().map(|w| w[0] > 0.0).collect::<Vec<_>>(), {
        let mut kept = vec![true; 10];
        kept[4] = false;
        kept
    });
    assert!(found.moves.is_empty() && apart(&clean, &found)[0] < 0.05);
}

#[test]
fn a_move_is_found_where_it_was() {
    let moved = [POSE[0] + 0.004, POSE[1] - 0.003, POSE[2] + 0.01, POSE[3]];
    let frames = [discharge(POSE, 9, 41), discharge(moved, 8, 61)].concat();
    let found = fused(&frames, None);
    assert_eq!(found.moves.iter().map(|m| m.index).collect::<Vec<_>>(), [9]);
    assert!((found.moves[0].turn - 0.005).abs() < 5e-4 && (found.moves[0].shift - 0.01).abs() < 1e-3);
    let alone = fused(&frames[9..], None);
    assert!(apart(&alone, &found)[0] < 1e-6);
}

#[test]
fn a_move_shows_against_frames_that_are_added_up() {
    let before = discharge(POSE, 9, 81);
    let earlier = fused(&before, None).added_up(&before, 9, None).expect("nine frames");
    let moved = [POSE[0], POSE[1] + 0.006, POSE[2], POSE[3] + 0.012];
    let found = fused(&discharge(moved, 5, 91), Some(&earlier));
    assert_eq!(found.moves.iter().map(|m| m.index).collect::<Vec<_>>(), [0]);
    assert!(fused(&discharge(POSE, 5, 91), Some(&earlier)).moves.is_empty());
}

#[test]
fn another_cone_is_no_move() {
    // a funnel of feed sinks before the hopper shows
    let funnel = |k: usize| silo(POSE, 1.1, 3.2 + 0.25 * k as f64);
    let mut frames: Vec<FrameFactor> = (0..5)
        .map(|k| FrameFactor { model: Model::FreeCone, hopper: false, ..frame(&funnel(k), &funnel(k), 9.0, 200 + k) })
        .collect();
    frames.extend((0..7).map(|k| frame(&hopper(POSE), &hopper(POSE), 3.9 + 0.1 * k as f64, 300 + k)));
    let found = fused(&frames, None);
    let std = stds(&found);
    assert!(found.moves.is_empty());
    assert!(found.common.weights.iter().all(|w| w[0] > 0.5), "{:?}", found.common.weights);
    assert!((0..4).all(|k| (found.answer.parameters[k] - POSE[k]).abs() < 3.0 * std[k]));
    let slope = found.answer.parameters[5];
    assert!((slope - 0.6).abs() < 0.02, "{slope}");
}
