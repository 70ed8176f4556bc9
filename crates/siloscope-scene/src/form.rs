//! The wall's form over its whole height: a bent generatrix, and rings of sheet of different radius.

use crate::jet::{Jet, Limits, smooth};
use crate::limits::bounded;
use siloscope::Result;

/// Half the height over which the radius steps from one course to the next, metres.
const HALF_STEP: f64 = 0.01;

/// Circles whose centres leave the axis by a parabola that a straight line through them all does not see.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bend {
    /// Displacement at both ends of the cylinder, towards `azimuth`; half of it the other way in the middle.
    pub depth: f64,
    /// Azimuth, rad.
    pub azimuth: f64,
}

impl Bend {
    /// Checks its size.
    pub fn validate(&self, radius: f64) -> Result<()> {
        bounded("bend", self.depth.abs(), 0.0, 0.1 * radius, "at most 0.1 silo radii")?;
        bounded("bend_azimuth", self.azimuth, -1e3, 1e3, "a finite angle")
    }

    /// `depth·P₂(2 (z - top)/(bottom - top) - 1)·cos(azimuth)`; below the cylinder as at its end.
    pub fn jet(&self, radius: f64, azimuth: f64, z: f64, (top, bottom): (f64, f64)) -> Jet {
        let place = 2.0 * (z - top) / (bottom - top) - 1.0;
        let (shift, fall) =
            if place < 1.0 { (1.5 * place * place - 0.5, 6.0 * place / (bottom - top)) } else { (1.0, 0.0) };
        let (sin, cos) = (azimuth - self.azimuth).sin_cos();
        [self.depth * shift * cos, -self.depth * shift * sin / radius, self.depth * fall * cos]
    }

    /// Bounds over the cylinder.
    pub fn limits(&self, radius: f64, height: f64) -> Limits {
        let (depth, fall) = (self.depth.abs(), 6.0 * self.depth.abs() / height);
        Limits {
            inwards: depth,
            outwards: depth,
            slope: fall.hypot(depth / radius),
            bend: 2.0 * fall / height + 2.0 * fall / radius + depth / (radius * radius),
        }
    }
}

/// Rings of sheet: z of each edge, ascending, and how far the sheet above it stands outwards of the lowest one.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Courses(pub Vec<[f64; 2]>);

impl Courses {
    /// Outwards from the lowest course; the steps are smooth over 20 mm.
    pub fn jet(&self, z: f64) -> Jet {
        let mut sum = [0.0; 3];
        for (i, [edge, offset]) in self.0.iter().enumerate() {
            let step = offset - self.0.get(i + 1).map_or(0.0, |next| next[1]);
            let place = 0.5 - 0.5 * (z - edge) / HALF_STEP;
            let (share, slope) = smooth(place.clamp(0.0, 1.0));
            sum[0] += step * share;
            sum[2] -= 0.5 * step * slope / HALF_STEP;
        }
        sum
    }

    /// Bounds; steps never overlap.
    pub fn limits(&self) -> Limits {
        let mut most = Limits::default();
        for (i, [_, offset]) in self.0.iter().enumerate() {
            let step = (offset - self.0.get(i + 1).map_or(0.0, |next| next[1])).abs();
            most = most.widest(Limits {
                inwards: (-offset).max(0.0),
                outwards: offset.max(0.0),
                slope: 1.875 * step / (2.0 * HALF_STEP),
                bend: 5.7736 * step / (4.0 * HALF_STEP * HALF_STEP),
            });
        }
        most
    }
}
