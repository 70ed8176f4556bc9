//! The surface fit of a cloud: a voxel grid's points in, the wall measured by the points of its surface's tiles out.

use crate::Result;
use crate::Vec3;
use crate::base::clock::Clock;
use crate::base::refusal::Refusal;
use crate::base::workers::Workers;
use crate::geometry::sensor::{DepthBias, DepthError, NoiseLaw};
use crate::geometry::surface::SurfaceTolerance;
use crate::stats::voxel_grid::voxel_grid;
use crate::surface_fit::cloud_equations::CloudWall;
use crate::surface_fit::cloud_tiles::cloud_patches;
use crate::surface_fit::model_selection::{Settled, coarse_fit};
use crate::surface_fit::outcome::{Knowledge, Outcome};
use crate::surface_fit::points::finish;
use crate::surface_fit::solver::{Prior, Problem};
use crate::surface_fit::warm_start::KnownWall;
use std::borrow::Cow;

/// Fits the wall to a cloud of points in the camera's frame, thinned by a voxel grid with cells of `grid` metres.
///
/// A cloud may be seen from inside or outside, and its origin need not be a camera: residuals are distances from the
/// wall, weighed by each patch's own scatter, and normals have no sign.
pub fn fit_cloud(points: &[Vec3], grid: f64, workers: &Workers, know: &Knowledge) -> Result<Outcome> {
    let mut clock = Clock::start();
    let cloud = voxel_grid(points, grid, workers)?;
    let mut patches = cloud_patches(&cloud, workers)?;
    if patches.list.len() < 30 {
        return Ok(Err(Refusal::NoDepth));
    }
    clock.lap("patches");
    let exact = DepthError { bias: DepthBias::default(), bias_std: [0.0; 3], noise: None };
    let prior = Knowledge { error: exact, ..know.clone() }.prior();
    let noise = NoiseLaw::uniform(1e-3); // not used: patches of a cloud carry their own scatter
    let found = match coarse_fit(&mut patches, noise, &prior, 0.0).0 {
        Ok(found) => found,
        Err(refusal) => return Ok(Err(refusal)),
    };
    clock.lap("coarse fit");
    let on_wall = cloud.of_points(points, &found.wall);
    let wall = |_: &DepthBias| CloudWall { points: Cow::Borrowed(points), on_wall: &on_wall, grid, by_rays: false };
    let mut result = match tiled(wall, (noise, &prior), found) {
        Ok(found) => found,
        Err(refusal) => return Ok(Err(refusal)),
    };
    clock.lap("covariance");
    result.timing = clock.laps();
    result.fit.inside = result.is_seen_from_inside();
    Ok(Ok(result))
}

/// So near to where they were made equations are as good as linear: what is left out is a hundredth of the step.
const LINEAR: SurfaceTolerance = SurfaceTolerance { tilt: 0.003, shift: 0.01, radius: 0.01, slope: 0.1, apex: 0.1 };
/// So often equations are made anew where the answer is further away, as it is where a frame leaves much open.
const MOST_ROUNDS: usize = 4;

/// The wall that tiles or voxels have settled on, measured by the points of its surface's tiles; `seen` places the points
/// by a depth bias.
pub fn tiled<'a>(
    seen: impl Fn(&DepthBias) -> CloudWall<'a>,
    (noise, prior): (NoiseLaw, &Prior),
    found: Settled,
) -> Outcome {
    let known = KnownWall::of(&found);
    let Settled { mut fit, evidence, bare, .. } = found;
    fit.surface = fit.surface.without(bare);
    let mut rounds = 0;
    loop {
        let tiles = seen(&fit.bias).tiles(fit.surface);
        let problem = Problem { patches: &tiles.patches, noise, prior, pixel: 0.0 };
        let mut equations = tiles.equations(&problem, &fit);
        let mut result = finish(&problem, fit.clone(), &mut equations, (evidence, known))?;
        let settled = rounds > 0 && result.fit.surface.is_near(&fit.surface, &LINEAR);
        if settled || rounds == MOST_ROUNDS {
            result.patches = tiles.patches;
            return Ok(result);
        }
        fit = result.fit;
        rounds += 1;
    }
}
