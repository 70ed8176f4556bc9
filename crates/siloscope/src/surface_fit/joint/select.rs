//! Models weighed against each other by Laplace evidence, and the answer averaged over them.

use crate::geometry::surface::Part;
use crate::surface_fit::joint::average::{self, Average, Candidate};
use crate::surface_fit::joint::frame::Frame;
use crate::surface_fit::joint::model::Model;
use crate::surface_fit::joint::parameters::SIZE;
use crate::surface_fit::joint::solve::JointFit;

/// A model's log evidence and what it says.
#[derive(Debug, Clone)]
pub struct Weighed {
    /// The model.
    pub model: Model,
    /// Which of the fits it is read from.
    pub fit: usize,
    /// ln p(frame, model), up to a constant.
    pub log_evidence: f64,
    /// Its probability among the models that were weighed.
    pub probability: f64,
    /// Its mean.
    pub mean: [f64; SIZE],
}

/// Cost of a patch of deposit, nats: the label must not explain what a model does not.
const DEPOSIT_COST: f64 = 20.0;

/// Weighs all models that the fits' parts allow: fits of the same parts compete by their best.
pub fn weigh(frame: &Frame, fits: &[JointFit]) -> Vec<Weighed> {
    let factors = common_factors(fits);
    let mut found: Vec<Weighed> = Vec::new();
    for (k, fit) in fits.iter().enumerate() {
        let likelihood: f64 = fit.labels.log_likelihood.iter().zip(&factors).map(|(ll, f)| ll / f).sum();
        let rest = fit.amplitudes.log_prior(fit.state.size()) - DEPOSIT_COST * fit.labels.patches as f64;
        for &model in Model::of(&fit.state).iter().filter(|model| !frame.told_cone || !model.is_oblique()) {
            let Some(posterior) = fit.posterior(frame, model) else { continue };
            let log_evidence = likelihood + rest + posterior.log_evidence + model.log_prior();
            let mean = std::array::from_fn(|i| fit.state.x[i] + posterior.step[i]);
            let new = Weighed { model, fit: k, log_evidence, probability: 0.0, mean };
            match found.iter_mut().find(|w| w.model == model) {
                Some(old) if old.log_evidence < log_evidence => *old = new,
                Some(_) => {}
                None => found.push(new),
            }
        }
    }
    let most = found.iter().map(|w| w.log_evidence).fold(f64::NEG_INFINITY, f64::max);
    found.iter_mut().for_each(|w| w.probability = (w.log_evidence - most).exp());
    let total: f64 = found.iter().map(|w| w.probability).sum();
    found.iter_mut().for_each(|w| w.probability /= total);
    found.sort_by(|a, b| b.probability.total_cmp(&a.probability));
    found
}

/// Correlation factor of each tile, the same for all models: else a model that fits badly is favoured by its own large
/// factor. The least of the fits' own counts.
fn common_factors(fits: &[JointFit]) -> Vec<f64> {
    let n = fits.iter().map(|f| f.sights.len()).max().unwrap_or(0);
    let most = fits.iter().map(|f| (f.state.has_cylinder, f.state.has_cone)).max();
    let mut factors = vec![f64::INFINITY; n];
    for fit in fits.iter().filter(|f| Some((f.state.has_cylinder, f.state.has_cone)) == most) {
        for (i, factor) in factors.iter_mut().enumerate() {
            let wall = fit.labels.wall.get(i).is_some_and(|p| *p > 0.5);
            let part = fit.sights.get(i).copied().flatten().map_or(Part::Cylinder, |s| s.at.part);
            let own = if wall { fit.correlation[usize::from(part == Part::Cone)] } else { 1.0 };
            *factor = factor.min(own);
        }
    }
    factors.iter_mut().for_each(|f| *f = if f.is_finite() { *f } else { 1.0 });
    factors
}

/// Mean and covariance of the parameters over a frame's models.
pub fn averaged(frame: &Frame, fits: &[JointFit], weighed: &[Weighed], exact_camera: bool) -> Option<Average> {
    let candidate = |w: &Weighed| {
        let fit = fits.get(w.fit)?;
        Some(Candidate {
            model: w.model,
            probability: w.probability,
            quadratic: &fit.quadratic,
            state: &fit.state,
            amplitudes: fit.amplitudes,
            reference: fit.state.reference,
        })
    };
    let candidates: Option<Vec<Candidate>> = weighed.iter().map(candidate).collect();
    average::averaged(&candidates?, frame.inputs, frame.form, exact_camera)
}
