//! What is known before a frame's content is measured.

use super::bound::Bound;
use super::jacobian::Covariance;
use super::under::Under;
use crate::SiloPose;
use crate::geometry::floor_map::FloorMap;
use crate::geometry::sensor::{DepthBias, NoiseLaw};
use crate::geometry::vessel::Vessel;

/// What is known before the frame.
#[derive(Debug, Clone)]
pub struct Setup {
    /// Pose of the camera.
    pub pose: SiloPose,
    /// The silo.
    pub vessel: Vessel,
    /// The floor, where it is not the vessel's cone; the vessel's own is then out of sight.
    pub floor: Option<FloorMap>,
    /// How well pose, geometry and depth bias are known.
    pub covariance: Covariance,
    /// How uneven the wall is, metres (standard deviation).
    pub wall_std: f64,
    /// The sensor's bias, as the calibration has it.
    pub bias: DepthBias,
    /// The sensor's noise.
    pub noise: NoiseLaw,
    /// Whether that is the sensor's own noise and no guess.
    pub noise_known: bool,
    /// Depths that the sensor can measure.
    pub range: [f64; 2],
}

impl Setup {
    /// What lies under the content.
    pub fn under(&self) -> Under<'_> {
        Under { vessel: &self.vessel, map: self.floor.as_ref() }
    }

    /// The cylinder with the variance of a point's distance to it.
    pub fn bound(&self) -> Bound {
        let c = &self.covariance;
        let constant = c[(2, 2)].max(c[(3, 3)]) + c[(4, 4)] + self.wall_std * self.wall_std;
        let by_depth = c[(0, 0)].max(c[(1, 1)]) + c[(8, 8)];
        let vessel = &self.vessel;
        let reach = 2.0 * (vessel.apex.abs() + vessel.radius + vessel.outlet_length);
        let camera = [self.pose.t_x, self.pose.t_y];
        Bound::new(vessel.radius, [constant, by_depth], &self.noise, reach, vessel.top, camera)
    }
}
