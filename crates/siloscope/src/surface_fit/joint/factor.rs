//! A fit's factor: what its tiles say, without what was known before.

use crate::geometry::surface::Part;
use crate::surface_fit::frame_factor::{FrameFactor, Kind, RAYS, Ray, Share};
use crate::surface_fit::joint::frame::Frame;
use crate::surface_fit::joint::model::Model;
use crate::surface_fit::joint::search::{tiles_met, wall_tiles};
use crate::surface_fit::joint::solve::JointFit;

/// The factor of a fit whose most probable model is `model`; `hopper` tells whether its cone is known to be the silo's.
pub fn frame_factor(frame: &Frame, fit: &JointFit, (model, hopper): (Model, bool), scale_std: f64) -> FrameFactor {
    let fractions = sensor_fractions(frame, fit);
    let (tiles, met) = (wall_tiles(fit), tiles_met(fit).max(1.0));
    let share = |(p, kind): (usize, Kind)| {
        let part = &fit.quadratic.parts[p];
        (tiles[p] > 0.0).then(|| Share {
            kind,
            information: part.information.clone(),
            gradient: part.gradient.clone(),
            sensor_fraction: fractions[p],
            seen: tiles[p] / met,
        })
    };
    FrameFactor {
        state: fit.state.clone(),
        model,
        hopper,
        shares: [Kind::Cylinder, Kind::Cone].into_iter().enumerate().filter_map(share).collect(),
        known: frame.inputs.clone(),
        scale_std,
        rays: rays(frame, fit, model == Model::CoaxialCone),
    }
}

/// Fraction of each part's score variance that the sensor's noise makes.
fn sensor_fractions(frame: &Frame, fit: &JointFit) -> [f64; 2] {
    let mut sums = [[0.0; 2]; 2];
    for (i, sight) in fit.sights.iter().enumerate() {
        let Some(sight) = sight else { continue };
        let p = usize::from(sight.at.part == Part::Cone);
        let weight = fit.labels.wall[i] / fit.labels.variance[i];
        sums[p][0] += weight * frame.readings.variance[i] / (fit.labels.variance[i] * fit.correlation[p]);
        sums[p][1] += weight;
    }
    sums.map(|[noise, all]| if all > 0.0 { (noise / all).min(1.0) } else { 0.0 })
}

/// Some of the wall's rays with their information, where the depth bias is free.
fn rays(frame: &Frame, fit: &JointFit, cone: bool) -> Vec<Ray> {
    if frame.inputs.bias_std == [0.0; 3] {
        return Vec::new();
    }
    let parts = [Part::Cylinder, Part::Cone].into_iter().filter(|part| cone || *part == Part::Cylinder);
    parts.flat_map(|part| rays_of(frame, fit, part)).collect()
}

fn rays_of(frame: &Frame, fit: &JointFit, part: Part) -> Vec<Ray> {
    let wall = |&i: &usize| fit.labels.wall[i] > 0.5 && fit.sights[i].is_some_and(|s| s.at.part == part);
    let tiles: Vec<usize> = (0..fit.sights.len()).filter(wall).collect();
    let n = RAYS.min(tiles.len());
    let stands_for = tiles.len() as f64 / n.max(1) as f64;
    let ray = |k: usize| {
        let i = tiles[(2 * k + 1) * tiles.len() / (2 * n)];
        let q = frame.readings.patches.list[i].q;
        [q.x, q.y, stands_for * fit.labels.wall[i] / fit.labels.variance[i]]
    };
    (0..n).map(ray).collect()
}
