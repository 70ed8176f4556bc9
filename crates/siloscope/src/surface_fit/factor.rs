//! The factor of a fit in twelve parameters, from its last equations.

use crate::geometry::parameters::{Information, PARAMETERS, Parameters};
use crate::surface_fit::equation::{TileEquation, tukey};
use crate::surface_fit::frame_factor::{FrameFactor, restrict, whole_share};
use crate::surface_fit::joint::model::{Inputs, Model};
use crate::surface_fit::joint::search::state_of;
use crate::surface_fit::solver::{Fit, System};

/// From the system of all parameters with its covariance as the residuals have it, the last equations and how they pull,
/// which parameters are free, and what was known before.
pub fn frame_factor(
    fit: &Fit,
    (system, covariance): (&System, &Information),
    (tiles, pulls): (&[TileEquation], &[f64]),
    free: &[bool; PARAMETERS],
    known: Inputs,
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
    let joint = restrict(&(information + system.prior), free);
    let scatter = joint * covariance * joint - restrict(&system.prior, free);
    let seen = (radius, 0.5);
    let share = whole_share((&information, &gradient), (&scatter, &noise), free, seen);
    let shape = match (state.has_cylinder, state.has_cone) {
        (true, true) => Model::CoaxialCone,
        (true, false) => Model::Cylinder,
        _ => Model::ConeAlone,
    };
    FrameFactor { state, model: shape, hopper: true, shares: vec![share], known, scale_std: 0.0, rays: Vec::new() }
}
