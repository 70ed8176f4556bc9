//! What one frame alone says about all parameters, without priors, in a form that adds up over frames.
//!
//! Near the answer θ the frame's negative log-likelihood is g·δ + δᵀΛδ/2 for a step δ. Λ and g add up over frames; how
//! uncertain their sum is depends on how much of g's scatter is new in every frame (the sensor's noise) and how much
//! comes back (dents, corrugation, a warped lens).

use crate::polish::TileEquation;
use crate::refine::{System, tukey};
use crate::surface::{Information, PARAMETERS, Parameters};

/// What one frame alone says.
#[derive(Debug, Clone)]
pub struct FrameShare {
    /// Information Λ.
    pub information: Information,
    /// Gradient g of the negative log-likelihood at the answer; the priors' gradient balances it.
    pub gradient: Parameters,
    /// Covariance of g as the residuals have it.
    pub scatter: Information,
    /// The part of `scatter` that the sensor's noise makes.
    pub noise: Information,
    /// Information of the priors, which were used but are not contained in the others.
    pub prior: Parameters,
}

impl FrameShare {
    /// From the last equations and how they pull, the system they make, and the covariance of the free parameters.
    pub fn new(
        (system, covariance): (&System, &Information),
        (tiles, pulls): (&[TileEquation], &[f64]),
        free: &[bool; PARAMETERS],
    ) -> Self {
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
        let joint = among(&(information + system.prior), free);
        let scatter = joint * covariance * joint - among(&system.prior, free);
        Self { information, gradient, scatter, noise, prior: system.prior.diagonal() }
    }
}

/// The rows and columns of the free parameters; zero elsewhere.
fn among(m: &Information, free: &[bool; PARAMETERS]) -> Information {
    m.map_with_location(|r, c, v| if free[r] && free[c] { v } else { 0.0 })
}
