//! What one frame alone says about all parameters, without priors, in a form that adds up over frames.
//!
//! Near the answer θ the frame's negative log-likelihood is g·δ + δᵀΛδ/2 for a step δ. Λ and g add up over frames; how
//! uncertain their sum is depends on how much of g's scatter is new in every frame (the sensor's noise) and how much
//! comes back (dents, corrugation, a warped lens).
//!
//! A frame's own answer may take the silo for round. What it says here never does: other frames may see its ovality.

use crate::fusion::relinearize::Ray;
use crate::geometry::parameters::{Information, PARAMETERS, Parameters};

/// What one frame alone says.
#[derive(Debug, Clone)]
pub struct FrameFactor {
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

/// The rows and columns of the free parameters; zero elsewhere.
pub fn restrict(m: &Information, free: &[bool; PARAMETERS]) -> Information {
    m.map_with_location(|r, c, v| if free[r] && free[c] { v } else { 0.0 })
}
