//! From where frames are fused: a frame's place, and the cone of the majority.

use crate::fusion::heights::Heights;
use crate::surface_fit::frame_factor::{FrameFactor, Kind};
use crate::surface_fit::joint::parameters::{
    CONE_FORM, CYLINDER_END, CYLINDER_FORM, INTERCEPT, JointState, OBLIQUITY, OFFSET, RADIUS, SLOPE,
};

/// Differences within which two cones may be the same: slope, and fractions of the radius.
const SAME_SLOPE: f64 = 0.05;
const SAME_SIZE: f64 = 0.02;

/// A start: the state, its heights, and which frames agree with it.
#[derive(Debug, Clone)]
pub struct Start {
    /// The state.
    pub state: JointState,
    /// Its heights.
    pub heights: Heights,
    /// Weight of every frame and of its cone: 1 where it agrees.
    pub agreeing: Vec<[f64; 2]>,
}

/// Frames of a number, evenly over all.
pub fn spread(count: usize, most: usize) -> Vec<usize> {
    let n = most.min(count);
    (0..n).map(|k| (2 * k + 1) * count / (2 * n)).collect()
}

/// Where frames of a silo may be fused: their heights, and the cone of most of them.
#[derive(Debug, Clone)]
pub struct Ground {
    /// Their heights.
    pub heights: Heights,
    cone: Option<JointState>,
    radius: Option<f64>,
}

/// A frame's height counts up to so many times that of the middle one.
const TALLEST: f64 = 3.0;

impl Ground {
    /// Of frames.
    pub fn of(frames: &[FrameFactor]) -> Self {
        let with_cylinder = frames.iter().filter(|frame| frame.state.has_cylinder);
        let mut references: Vec<f64> = with_cylinder.map(|frame| frame.state.reference).collect();
        references.sort_by(f64::total_cmp);
        let middle = references.get(references.len() / 2).copied().unwrap_or(1.0);
        let form = references.iter().copied().filter(|r| *r <= TALLEST * middle).fold(0.2, f64::max);
        let cone = common_cone(frames).map(|k| frames[k].state.clone());
        let heights = Heights { form, cone: cone.as_ref().map_or(form, |cone| cone.reference) };
        let radius = frames.iter().find(|frame| frame.state.has_cylinder).map(|frame| frame.state.x[RADIUS]);
        Self { heights, cone, radius }
    }

    /// A start at a frame's pose, with the cone of most.
    pub fn at(&self, frames: &[FrameFactor], base: usize) -> (JointState, Heights) {
        let mut state = frames[base].state.clone();
        if let Some(radius) = self.radius.filter(|_| !state.has_cylinder) {
            state.x[RADIUS] = radius;
        }
        (state.has_cylinder, state.has_cone) = (self.radius.is_some(), self.cone.is_some());
        state.x[CYLINDER_FORM..CYLINDER_END].fill(0.0);
        state.x[SLOPE..].fill(0.0);
        if let Some(cone) = &self.cone {
            state.x[SLOPE..CONE_FORM].copy_from_slice(&cone.x[SLOPE..CONE_FORM]);
        }
        state.reference = self.heights.cone;
        (state, self.heights)
    }

    /// Which frames may show the cone of most.
    pub fn cones(&self, frames: &[FrameFactor]) -> Vec<f64> {
        let same = |frame: &FrameFactor| self.cone.as_ref().is_some_and(|own| is_same_cone(&frame.state, own));
        frames.iter().map(|frame| if same(frame) { 1.0 } else { 0.0 }).collect()
    }
}

/// The frame that shows most of the wall.
pub fn fullest(frames: &[FrameFactor]) -> usize {
    let shows = |frame: &FrameFactor| {
        let cylinder = if frame.state.has_cylinder { 1.0 } else { 0.0 };
        cylinder + frame.shares.iter().map(|share| share.seen).sum::<f64>()
    };
    (0..frames.len()).max_by(|&a, &b| shows(&frames[a]).total_cmp(&shows(&frames[b]))).unwrap_or_default()
}

/// The frame with the cone that most frames show; of several the lowest.
fn common_cone(frames: &[FrameFactor]) -> Option<usize> {
    let cones: Vec<usize> = (0..frames.len()).filter(|&i| shows_cone(&frames[i])).collect();
    let votes = |i: usize| cones.iter().filter(|&&j| is_same_cone(&frames[i].state, &frames[j].state)).count();
    let low = |i: usize| frames[i].state.x[INTERCEPT] / frames[i].state.x[SLOPE].max(0.05);
    cones.iter().copied().max_by(|&a, &b| votes(a).cmp(&votes(b)).then(low(a).total_cmp(&low(b))))
}

fn shows_cone(frame: &FrameFactor) -> bool {
    frame.state.has_cone && frame.shares.iter().any(|share| share.kind != Kind::Cylinder)
}

/// Whether two cones may be the same surface: their radius and centre where each has its reference, and their slope.
fn is_same_cone(one: &JointState, other: &JointState) -> bool {
    if !one.has_cone || !other.has_cone {
        return false;
    }
    let radius = |s: &JointState, z: f64| s.x[INTERCEPT] - s.x[SLOPE] * z;
    let centre = |s: &JointState, k: usize, z: f64| s.x[OFFSET + k] + s.x[OBLIQUITY + k] * (z - s.reference);
    let near = |z: f64| {
        let size = SAME_SIZE * one.size().max(other.size());
        (radius(one, z) - radius(other, z)).abs() < size
            && (0..2).all(|k| (centre(one, k, z) - centre(other, k, z)).abs() < size)
    };
    (one.x[SLOPE] - other.x[SLOPE]).abs() < SAME_SLOPE && near(one.reference) && near(other.reference)
}
