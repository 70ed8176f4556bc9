//! What lies under the content: the vessel's cone, or a floor that is known as a map.

use super::jacobian::{CalibrationJacobian, Parameters};
use crate::geometry::floor_map::FloorMap;
use crate::geometry::vessel::{Shells, Vessel};

/// The floor of a vessel.
#[derive(Debug, Clone, Copy)]
pub struct Under<'a> {
    /// The vessel; its cone is the floor where there is no map.
    pub vessel: &'a Vessel,
    /// The floor.
    pub map: Option<&'a FloorMap>,
}

impl Under<'_> {
    /// z of the floor at a place whose distance from the axis is `r`.
    pub fn z(&self, [x, y]: [f64; 2], r: f64) -> f64 {
        self.map.map_or_else(|| self.vessel.floor(r), |map| map.z(x, y))
    }

    /// Mean z of the floor over a square cell about a place.
    pub fn over_cell(&self, [x, y, _]: [f64; 3], cell: f64) -> f64 {
        self.map.map_or_else(|| self.vessel.floor(mean_radius([x, y], cell)), |map| map.z(x, y))
    }

    /// Slopes dz/dx and dz/dy.
    pub fn slopes(&self, x: f64, y: f64) -> [f64; 2] {
        if let Some(map) = self.map {
            return map.slopes(x, y);
        }
        let ([height, run], r) = (self.rise(), x.hypot(y).max(1e-9));
        let fall = -height / run / r;
        [fall * x, fall * y]
    }

    /// Standard deviation of z beside that of the vessel's lengths.
    pub fn std(&self, x: f64, y: f64) -> f64 {
        self.map.map_or(0.0, |map| map.std(x, y))
    }

    /// How steep the floor is on the whole: its height over its radius.
    pub fn rise(&self) -> [f64; 2] {
        self.map.map_or_else(|| [self.vessel.cone_height(), self.vessel.radius], FloorMap::rise)
    }

    /// Derivatives of its z by the vessel's lengths; a map hangs at the cylinder's lower edge, unless the camera saw it.
    pub fn derivatives(&self, r: f64) -> Shells {
        match self.map {
            Some(map) => Shells { cylinder_bottom: f64::from(u8::from(!map.of_camera)), ..Shells::default() },
            None if r < self.vessel.outlet_radius => Shells { apex: 1.0, ..Shells::default() },
            None => self.vessel.cone_derivatives(r),
        }
    }

    /// Derivatives by the parameters of how far a point lies above the floor; none where one camera saw both.
    pub fn thickness(&self, point: [f64; 3], jacobian: &CalibrationJacobian) -> Parameters {
        let [x, y, _] = point;
        match self.map {
            Some(map) if map.of_camera => Parameters::zeros(),
            Some(map) => {
                let mut out = -jacobian.heights(point, map.slopes(x, y));
                out[5] += 1.0;
                out
            }
            None => jacobian.thickness(point, self.vessel),
        }
    }
}

/// Mean distance from the axis over a square cell: `√(r² + c s²)` with the square's variance s².
///
/// c = 1/2 is right far from the axis, and 0.878 for a square about the axis.
fn mean_radius([x, y]: [f64; 2], cell: f64) -> f64 {
    let (square, spread) = (x * x + y * y, cell * cell / 6.0);
    (square + (0.5 + 0.378 / (1.0 + square / spread)) * spread).sqrt()
}
