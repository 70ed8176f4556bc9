//! What one frame alone says about all parameters, without priors, in a form that adds up over frames.
//!
//! Near the answer θ the frame's negative log-likelihood is g·δ + δᵀΛδ/2 for a step δ. Λ and g add up over frames; how
//! uncertain their sum is depends on how much of g's scatter is new in every frame (the sensor's noise) and how much
//! comes back (dents, corrugation, a warped lens).
//!
//! A frame's own answer may take the silo for round. What it says here never does: other frames may see its ovality.

use crate::fusion::relinearize::Ray;
use crate::geometry::parameters::{Information, OVALITY, PARAMETERS, Parameters};
use crate::surface_fit::polish::TileEquation;
use crate::surface_fit::solver::{System, tukey};

/// What one frame alone says.
#[derive(Debug, Clone)]
pub struct FrameShare {
    /// From the frame's own answer to θ: what its ovality would change, where the answer leaves it out.
    pub step: Parameters,
    /// Information Λ.
    pub information: Information,
    /// Gradient g of the negative log-likelihood at θ; the priors' gradient balances it.
    pub gradient: Parameters,
    /// Covariance of g as the residuals have it.
    pub scatter: Information,
    /// The part of `scatter` that the sensor's noise makes.
    pub noise: Information,
    /// Information of the priors, which were used but are not contained in the others.
    pub prior: Parameters,
    /// Where the frame's equations were made: the wall and bias of which Λ has the derivatives; NaN for what is not there.
    pub base: Parameters,
    /// Some of its rays, to tell what it says about walls far from there; none where the depth bias is known.
    pub rays: Vec<Ray>,
}

impl FrameShare {
    /// From the system of all parameters with its covariance, as the noise has it and as the residuals have it; the
    /// last equations and how they pull; which parameters are free in the frame's own answer, and here; where the
    /// equations were made, and on which rays.
    pub fn new(
        (system, model, covariance): (&System, &Information, &Information),
        (tiles, pulls): (&[TileEquation], &[f64]),
        (alone, free): (&[bool; PARAMETERS], &[bool; PARAMETERS]),
        (base, rays): (Parameters, Vec<Ray>),
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
        let mut step = Parameters::zeros();
        if free[OVALITY] && !alone[OVALITY] {
            // all other parameters are at their best already
            step = -model.fixed_columns::<2>(OVALITY) * gradient.fixed_rows::<2>(OVALITY);
            gradient += information * step;
        }
        let joint = among(&(information + system.prior), free);
        let scatter = joint * covariance * joint - among(&system.prior, free);
        Self { step, information, gradient, scatter, noise, prior: system.prior.diagonal(), base, rays }
    }
}

/// The rows and columns of the free parameters; zero elsewhere.
pub fn among(m: &Information, free: &[bool; PARAMETERS]) -> Information {
    m.map_with_location(|r, c, v| if free[r] && free[c] { v } else { 0.0 })
}
