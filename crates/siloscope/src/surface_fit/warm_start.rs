//! A wall that another frame of the same camera has shown: a camera seldom moves, so it is looked for there first.
//!
//! Only the search is spared. What is found stands up to the same evidence as a wall found from nothing, and it must
//! confirm the known wall: whatever is new, lost, moved, or hard to see sends the frame back to the search.

use crate::geometry::sensor::{DepthBias, NoiseLaw};
use crate::geometry::surface::{SiloSurface, SurfaceTolerance};
use crate::surface_fit::model_selection::{Settled, settled, with_free_size};
use crate::surface_fit::solver::{Fit, Prior, Problem};
use crate::surface_fit::tiles::Patches;

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
    /// Whether the frame's pixels showed that it is oval.
    pub oval: bool,
}

/// Least share of the patches that must be wall: a frame that shows less is searched for what else it may show.
pub(crate) const LEAST_SHARE: f64 = 0.35;
/// Most misfit where the depth's bend is fitted too, as a share of the silo's size: a rough wall and a bent depth trade.
const MOST_MISFIT: f64 = 1e-3;
/// How far the wall may be from the known one.
const SAME: SurfaceTolerance = SurfaceTolerance { tilt: 0.01, shift: 0.03, radius: 0.03, slope: 0.05, apex: 0.06 };
/// Misfit of the first step as a multiple of the known one: it can only fall, and what agrees must not depend on it.
const LOOSER: f64 = 6.0;

/// The wall on patches, started from a known one; `None` where the frame does not plainly confirm that.
pub fn confirmed(
    patches: &mut Patches,
    noise: NoiseLaw,
    prior: &Prior,
    pixel: f64,
    known: &KnownWall,
) -> Option<Settled> {
    let prior = &with_free_size(prior);
    let mut fit = known.loose_fit(patches.list.len());
    let bends = prior.bias_std[2] > 0.0;
    if bends {
        Problem { patches, noise, prior, pixel }.refine(&mut fit, 3, 4, 0.2);
        patches.unbias_normals(&fit.bias);
    }
    let found = settled(&Problem { patches, noise, prior, pixel }, fit).ok()?;
    let rough = known.misfit.max(found.fit.misfit) > MOST_MISFIT * found.fit.surface.size();
    let same = known.is_same(&found.fit.surface.without(found.bare));
    (!(bends && rough) && found.evidence.share > LEAST_SHARE && same).then_some(found)
}

impl KnownWall {
    /// What a frame passes on to others.
    pub fn of(found: &Settled) -> Self {
        let Fit { surface, bias, inside, misfit, .. } = found.fit;
        Self { surface, bias, inside, misfit, oval: false }
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

    fn loose_fit(&self, patches: usize) -> Fit {
        Fit { misfit: LOOSER * self.misfit, weights: vec![0.0; patches], ..self.fit() }
    }

    /// Whether a wall has the same parts, in the same place.
    pub fn is_same(&self, found: &SiloSurface) -> bool {
        found.is_near(&self.surface, &SAME)
    }
}
