//! The factor of a fit in twelve parameters, from its last equations.

use crate::Vec3;
use crate::geometry::parameters::{Information, OVALITY, PARAMETERS, Parameters};
use crate::geometry::surface::Part;
use crate::surface_fit::equation::{TileEquation, tukey};
use crate::surface_fit::frame_factor::{FrameFactor, RAYS, Ray, restrict, whole_share};
use crate::surface_fit::joint::model::{Inputs, Model};
use crate::surface_fit::joint::search::state_of;
use crate::surface_fit::solver::{Fit, System};

/// From the system of all parameters with its covariance, as the noise has it and as the residuals have it; the
/// last equations and how they pull; which parameters are free in the frame's own answer, and here; what was known
/// before, and the rays that are kept.
pub fn frame_factor(
    fit: &Fit,
    (system, model, covariance): (&System, &Information, &Information),
    (tiles, pulls): (&[TileEquation], &[f64]),
    (alone, free): (&[bool; PARAMETERS], &[bool; PARAMETERS]),
    (known, scale_std, rays): (Inputs, f64, Vec<Ray>),
) -> FrameFactor {
    let mut information = system.information - system.prior;
    information.fill_upper_triangle_with_lower_triangle();
    let (mut gradient, mut sensor) = (Parameters::zeros(), System::empty());
    for (TileEquation { equation: e, noise, .. }, pull) in tiles.iter().zip(pulls) {
        gradient += e.jacobian * *pull;
        let weight = tukey(e.residual * e.residual / e.variance);
        sensor.add_row(&e.jacobian, 0.0, weight * noise / (e.variance * e.variance));
    }
    let mut noise = sensor.information;
    noise.fill_upper_triangle_with_lower_triangle();
    let state = state_of(fit);
    let radius = fit.surface.radius.unwrap_or(1.0);
    let mut step = Parameters::zeros();
    if free[OVALITY] && !alone[OVALITY] {
        // all other parameters are at their best already
        step = -model.fixed_columns::<2>(OVALITY) * gradient.fixed_rows::<2>(OVALITY);
        gradient += information * step;
    }
    let joint = restrict(&(information + system.prior), free);
    let scatter = joint * covariance * joint - restrict(&system.prior, free);
    let seen = (radius, 0.5);
    let mut share = whole_share((&information, &gradient), (&scatter, &noise), free, seen);
    let back: Vec<f64> = (0..PARAMETERS).map(|k| -step[k] * if k >= OVALITY { radius } else { 1.0 }).collect();
    share.gradient = share.gradient_after(&back);
    let shape = match (state.has_cylinder, state.has_cone) {
        (true, true) => Model::CoaxialCone,
        (true, false) => Model::Cylinder,
        _ => Model::ConeAlone,
    };
    FrameFactor { state, model: shape, hopper: true, shares: vec![share], known, scale_std, rays }
}

/// Least share of the rays for a part that is seen.
const LEAST: usize = RAYS / 4;

/// Some of the wall tiles' rays, of both parts, with the information of all; `ray_of` tells that of a patch.
pub fn some_rays(tiles: &[TileEquation], ray_of: impl Fn(usize) -> Vec3) -> Vec<Ray> {
    let of_part = |part: Part| tiles.iter().filter(|t| t.equation.part == part).collect::<Vec<_>>();
    let (cylinder, cone) = (of_part(Part::Cylinder), of_part(Part::Cone));
    let share = RAYS * cone.len() / tiles.len().max(1);
    let most = RAYS - LEAST.min(cylinder.len());
    let of_cone = share.max(LEAST.min(cone.len())).min(most);
    [(cylinder, RAYS - of_cone), (cone, of_cone)].iter().flat_map(|(tiles, n)| spread(tiles, *n, &ray_of)).collect()
}

/// At most n of the tiles, evenly among them, each with the information of those it stands for.
fn spread(tiles: &[&TileEquation], n: usize, ray_of: &impl Fn(usize) -> Vec3) -> Vec<Ray> {
    let n = n.min(tiles.len());
    let stands_for = tiles.len() as f64 / n.max(1) as f64;
    let ray = |tile: &TileEquation| {
        let (q, e) = (ray_of(tile.patch), &tile.equation);
        [q.x, q.y, stands_for * tukey(e.residual * e.residual / e.variance) / e.variance]
    };
    (0..n).map(|k| ray(tiles[(2 * k + 1) * tiles.len() / (2 * n)])).collect()
}
