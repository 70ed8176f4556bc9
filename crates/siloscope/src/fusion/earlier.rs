//! Frames added up: what remains of frames whose own factor is not kept.

use crate::fusion::heights::Heights;
use crate::fusion::placed::{Placed, Placing};
use crate::fusion::start::{Ground, Start};
use crate::fusion::sum::Shown;
use crate::surface_fit::frame_factor::FrameFactor;
use crate::surface_fit::joint::parameters::{JointState, RADIUS, SLOPE};

/// Earlier frames, added up as often as each counted among them.
#[derive(Debug, Clone)]
pub struct Earlier {
    /// The sums as one factor; the sensor's fraction and what is seen are means.
    pub factor: FrameFactor,
    /// The heights to which it is told.
    pub heights: Heights,
    /// For how many frames each share stands, by their weights.
    pub counted: Vec<f64>,
    /// Number of frames.
    pub frames: usize,
}

impl Earlier {
    /// What they have shown, share by share.
    pub fn shown(&self) -> Vec<Shown> {
        let of = |(share, frames): (&crate::surface_fit::frame_factor::Share, &f64)| Shown {
            kind: share.kind,
            sensor_fraction: share.sensor_fraction,
            seen: share.seen,
            frames: *frames,
        };
        self.factor.shares.iter().zip(&self.counted).map(of).collect()
    }

    /// About a common state.
    pub fn placed(&self, (state, heights): (&JointState, &Heights)) -> Placed {
        Placing::new(&self.factor, &self.heights, heights).about(state)
    }

    /// To start from, where they are the majority.
    pub fn start(&self, frames: &[FrameFactor]) -> Start {
        let mut state = self.factor.state.clone();
        let ground = Ground::of(frames);
        let (other, heights) = if frames.is_empty() { (state.clone(), self.heights) } else { ground.at(frames, 0) };
        let cone = if state.has_cone { self.heights.cone } else { heights.cone };
        if !state.has_cone && other.has_cone {
            state.has_cone = true;
            state.x[SLOPE..].copy_from_slice(&other.x[SLOPE..]);
        }
        if !state.has_cylinder && other.has_cylinder {
            state.has_cylinder = true;
            state.x[RADIUS] = other.x[RADIUS];
        }
        state.reference = cone;
        let heights = Heights { form: self.heights.form.max(heights.form), cone };
        Start { state, heights, agreeing: vec![[1.0; 2]; frames.len()] }
    }
}
