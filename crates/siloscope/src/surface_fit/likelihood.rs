//! How much of a frame a fit explains, and whether its cone may be feed.

use crate::geometry::evaluator::SurfaceEvaluator;
use crate::surface_fit::solver::{Fit, Problem};
use crate::surface_fit::vertex::is_covered;

/// Whether the cone could as well be feed.
pub(crate) fn may_be_feed(problem: &Problem, fit: &Fit) -> bool {
    fit.surface.cone.is_some_and(|c| c.may_be_feed()) && !is_covered(problem, fit)
}

/// Log-likelihood gain of calling every `stride`-th patch wall instead of anything else, where the fit says so.
pub(crate) fn likelihood(problem: &Problem, fit: &Fit, stride: usize) -> f64 {
    let placed = SurfaceEvaluator::new(fit.surface);
    let gain = |(i, &weight): (usize, &f64)| {
        let contact = if weight > 0.0 { problem.contact(fit, &placed, i) } else { None };
        contact.map_or(0.0, |e| weight * (0.5 / (e.variance.sqrt() * e.cosine)).ln().max(0.0))
    };
    fit.weights.iter().enumerate().step_by(stride).map(gain).sum()
}
