//! A wall that another frame of the same camera has shown: a camera seldom moves, so it is looked for there first.
//!
//! Only the search is spared. What is found stands up to the same evidence as a wall found from nothing, and it must
//! confirm the known wall: whatever is new, lost, moved, or hard to see sends the frame back to the search.

use crate::geometry::sensor::DepthBias;
use crate::geometry::surface::{SiloSurface, SurfaceTolerance};
use crate::surface_fit::model_selection::Settled;
use crate::surface_fit::solver::Fit;

/// Where another frame has found the wall, on patches.
#[derive(Debug, Clone, Copy)]
pub struct KnownWall {
    /// The wall.
    pub surface: SiloSurface,
    /// The depth bias that it was seen with.
    pub bias: DepthBias,
    /// Whether it was seen from inside.
    pub inside: bool,
    /// Its misfit, metres across the wall.
    pub misfit: f64,
}

/// Least share of the patches that must be wall: a frame that shows less is searched for what else it may show.
pub(crate) const LEAST_SHARE: f64 = 0.35;
/// How far the wall may be from the known one.
const SAME: SurfaceTolerance = SurfaceTolerance { tilt: 0.01, shift: 0.03, radius: 0.03, slope: 0.05, apex: 0.06 };

impl KnownWall {
    /// What a frame passes on to others.
    pub fn of(found: &Settled) -> Self {
        let Fit { surface, bias, inside, misfit, .. } = found.fit;
        Self { surface, bias, inside, misfit }
    }

    /// Forgets the parts that a wall does not have.
    pub fn drop_parts_without(&mut self, wall: &SiloSurface) {
        self.surface.radius = self.surface.radius.filter(|_| wall.radius.is_some());
        self.surface.cone = self.surface.cone.filter(|_| wall.cone.is_some());
    }

    /// As a fit of no patches.
    pub fn fit(&self) -> Fit {
        let Self { surface, bias, inside, misfit, .. } = *self;
        Fit { surface, bias, inside, misfit, weights: Vec::new() }
    }

    /// Whether a wall has the same parts, in the same place.
    pub fn is_same(&self, found: &SiloSurface) -> bool {
        found.is_near(&self.surface, &SAME)
    }
}
