//! The last linearisation: residuals of the pixels, not of the tiles' planes.

use crate::geometry::surface::Part;
use crate::surface_fit::joint::frame::Frame;
use crate::surface_fit::joint::labels::Labels;
use crate::surface_fit::joint::predict::{Predictor, Sight};
use crate::surface_fit::residual::{Sampling, tile_residual};

/// Tiles less likely to be wall keep their own mean.
const LIKELY: f64 = 0.02;
/// Pixels further off than so many standard deviations of a pixel and of the model error belong to something else.
const REACH: f64 = 4.0;
/// A tile counts where at least this fraction of its pixels does.
const ENOUGH: f64 = 0.5;

/// Pixels that scatter by less than this many of their standard deviations are all of one surface.
const EVEN: f64 = 1.3;

/// Puts the mean residual of the agreeing pixels in the place of the tiles' own, for tiles that may be wall and lack
/// pixels or hold some of something else. For all others the mean over the tile is that of its pixels already.
pub fn pixel_means(frame: &Frame, predictor: &Predictor, labels: &Labels, tau: [f64; 2], sights: &mut [Option<Sight>]) {
    for (i, sight) in sights.iter_mut().enumerate() {
        let likely = labels.wall.get(i).is_some_and(|p| *p > LIKELY);
        if let Some(seen) = sight.filter(|s| likely && !(s.bend.is_none_or(|bend| bend.even) && is_even(frame, i))) {
            *sight = pixel_mean(frame, predictor, tau, i, seen);
        }
    }
}

/// Whether all pixels of a tile are there and scatter as noise does.
fn is_even(frame: &Frame, i: usize) -> bool {
    let readings = frame.readings;
    let Some(patch) = readings.patches.list.get(i) else { return false };
    let side = readings.patches.side as f64;
    let expected = readings.variance.get(i).map_or(0.0, |v| v * patch.count / readings.patches.common_noise);
    patch.count >= side * side && patch.scatter * patch.scatter < EVEN * EVEN * expected
}

fn pixel_mean(frame: &Frame, predictor: &Predictor, tau: [f64; 2], i: usize, seen: Sight) -> Option<Sight> {
    let patch = frame.readings.patches.list.get(i)?;
    let part = seen.at.part;
    let single = (frame.readings.variance.get(i)? * patch.count).sqrt();
    let off = tau[usize::from(part == Part::Cone)] / seen.rate;
    let sampling = Sampling { stride: 1, reach: REACH * (single + off) };
    let (bias, bulge) = (predictor.state.bias(), predictor.bulge_at(&seen));
    let depth = |ray: [f64; 2]| predictor.true_depth(ray, part, bulge);
    let on_part = |ray: [f64; 2], _: f64| predictor.ends_on(ray, part, bulge);
    let found = tile_residual(frame.image, frame.readings.patches, i, &bias, sampling, on_part, depth);
    (found.count >= ENOUGH * patch.count).then_some(Sight { residual: found.mean, ..seen })
}
