//! Which end of a vessel is down.
//!
//! A cylinder looks the same upside down. That the camera looks down decides where it looks more down than sideways.
//! Else something must close the vessel at its lower end: a hopper, a floor, feed; or gravity tells.

use crate::base::refusal::Refusal;
use crate::surface_fit::joint::frame::Frame;
use crate::surface_fit::joint::search::{tiles_met, wall_tiles};
use crate::surface_fit::joint::solve::JointFit;

/// Cosine of the angle from the vertical up to which a camera is taken to look down: half a right angle.
const LOOKS_DOWN: f64 = std::f64::consts::FRAC_1_SQRT_2;
/// Least fraction of the tiles that shows an end.
const LEAST_END: f64 = 0.02;
/// A surface that closes the vessel faces along the axis within 60°: feed and floors do, walls don't. Cosine.
const FACES_ALONG: f64 = 0.5;

/// Refuses an axis that may as well point the other way.
pub fn judge_ends(frame: &Frame, fit: &JointFit) -> Result<(), Refusal> {
    let axis = fit.state.pose().axis_direction();
    if axis.z <= 0.0 {
        return Err(Refusal::AboveHorizon);
    }
    if frame.inputs.gravity.is_some() {
        return Ok(());
    }
    let least = LEAST_END * tiles_met(fit);
    let [bottom, top] = ends(frame, fit);
    let closed = wall_tiles(fit)[1] + bottom > least;
    if top > least.max(bottom) || axis.z < LOOKS_DOWN && !closed {
        return Err(Refusal::EndUnknown);
    }
    Ok(())
}

/// Numbers of smooth tiles beside the wall that face the camera against the axis and along it.
fn ends(frame: &Frame, fit: &JointFit) -> [f64; 2] {
    let axis = fit.state.pose().axis_direction();
    let mut count = [0.0; 2];
    for (i, patch) in frame.readings.patches.list.iter().enumerate() {
        let wall = fit.labels.wall.get(i).is_some_and(|p| *p > 0.5) || fit.labels.deposit.get(i).is_some_and(|d| *d);
        let along = patch.normal.dot(&axis);
        if patch.smooth && !wall && along.abs() > FACES_ALONG {
            count[usize::from(along > 0.0)] += 1.0;
        }
    }
    count
}
