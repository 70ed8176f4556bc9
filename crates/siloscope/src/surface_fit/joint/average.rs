//! Weighed models averaged: the answer of one frame, and of many that are solved together.

use crate::surface_fit::joint::form::Form;
use crate::surface_fit::joint::form_share;
use crate::surface_fit::joint::model::{Amplitudes, Inputs, Model, prior};
use crate::surface_fit::joint::parameters::{CAMERA, JointState, SIZE};
use crate::surface_fit::joint::system::{Posterior, Quadratic};
use nalgebra::{DMatrix, DVector};

/// Models less probable than this leave the answer as it is.
pub const NEGLIGIBLE: f64 = 1e-4;

/// A model that has been solved.
#[derive(Debug, Clone, Copy)]
pub struct Candidate<'a> {
    /// The model.
    pub model: Model,
    /// Its probability.
    pub probability: f64,
    /// Sum of squares about the state.
    pub quadratic: &'a Quadratic,
    /// The state.
    pub state: &'a JointState,
    /// The form's learned widths.
    pub amplitudes: Amplitudes,
    /// Height at which the cylinder's form ends, metres.
    pub reference: f64,
}

/// The averaged parameters.
#[derive(Debug, Clone)]
pub struct Average {
    /// Mean.
    pub mean: DVector<f64>,
    /// Covariance.
    pub covariance: DMatrix<f64>,
}

/// Mean and covariance of the parameters over the models: Σ w (C + d dᵀ), d the distance of a model's mean.
///
/// The cone's own parameters are averaged over the models that have one. Where the evidence prefers an ideal vessel, the
/// mean is that of one. The covariance is always that of a usual one: what is not seen may still be there. With an
/// `exact` camera it is that of poses of one camera to each other.
pub fn averaged(candidates: &[Candidate], inputs: &Inputs, form: &Form, exact: bool) -> Option<Average> {
    let mut parts = Vec::new();
    for one in candidates.iter().filter(|one| one.probability > NEGLIGIBLE) {
        let mut prior = prior(one.model, one.state, inputs, form, Some(&one.amplitudes));
        if exact {
            prior.std[CAMERA..][..5].fill(0.0);
        }
        let posterior = one.quadratic.posterior(&one.state.x, &prior)?;
        let wide = one.at(&posterior);
        let mean = one.ideal_mean(inputs, form, &posterior).unwrap_or_else(|| wide.clone());
        let off = &mean - &wide;
        let mut covariance = posterior.covariance();
        form_share::widen(one.state, one.reference, &wide, &mut covariance);
        parts.push((one.probability, mean, covariance + &off * off.transpose()));
    }
    let total: f64 = parts.iter().map(|p| p.0).sum();
    let first = parts.first()?.1.clone();
    let mean =
        parts.iter().fold(DVector::zeros(SIZE), |sum, (w, mean, _)| sum + (mean - &first) * (*w / total)) + &first;
    let covariance = parts.iter().fold(DMatrix::zeros(SIZE, SIZE), |sum, (w, of, covariance)| {
        let off = of - &mean;
        sum + (covariance + &off * off.transpose()) * (*w / total)
    });
    Some(Average { mean, covariance })
}

impl Candidate<'_> {
    fn at(&self, posterior: &Posterior) -> DVector<f64> {
        DVector::from_fn(SIZE, |i, _| self.state.x[i] + posterior.step[i])
    }

    /// Mean of a vessel that is as good as ideal, in its wall's form, its cone's place, or both, where the evidence
    /// prefers it.
    fn ideal_mean(&self, inputs: &Inputs, form: &Form, wide: &Posterior) -> Option<DVector<f64>> {
        let size = self.state.size();
        let learned = self.amplitudes.log_prior(size);
        let mut best = (wide.log_evidence + learned, None);
        for (is_form, is_cone) in [(true, true), (true, false), (false, true)] {
            let (amplitudes, own) =
                if is_form { (self.amplitudes.ideal(size), 0.0) } else { (self.amplitudes, learned) };
            let mut prior = prior(self.model, self.state, inputs, form, Some(&amplitudes));
            if is_cone && self.state.has_cone {
                self.model.place_cone(&mut prior, size, true);
            }
            let posterior = self.quadratic.posterior(&self.state.x, &prior)?;
            if posterior.log_evidence + own > best.0 {
                best = (posterior.log_evidence + own, Some(self.at(&posterior)));
            }
        }
        best.1
    }
}
