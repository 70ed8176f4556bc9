//! Models weighed against each other by Laplace evidence, and the answer averaged over them.

use crate::geometry::surface::Part;
use crate::surface_fit::joint::form_share;
use crate::surface_fit::joint::frame::Frame;
use crate::surface_fit::joint::model::{Model, prior};
use crate::surface_fit::joint::parameters::{CAMERA, SIZE};
use crate::surface_fit::joint::solve::JointFit;
use crate::surface_fit::joint::system::Posterior;
use nalgebra::{DMatrix, DVector};

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
        for &model in Model::of(&fit.state) {
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

/// Models less probable than this leave the answer as it is.
pub const NEGLIGIBLE: f64 = 1e-4;

/// Mean and covariance of the parameters over the models: Σ w (C + d dᵀ), d the distance of a model's mean.
///
/// The cone's own parameters are averaged over the models that have one. Where the evidence prefers an ideal vessel, the
/// mean is that of one. The covariance is always that of a usual one: what a frame does not show may
/// still be there.
pub fn averaged(frame: &Frame, fits: &[JointFit], weighed: &[Weighed], exact_camera: bool) -> Option<Average> {
    let mut parts = Vec::new();
    for w in weighed.iter().filter(|w| w.probability > NEGLIGIBLE) {
        let fit = fits.get(w.fit)?;
        let mut prior = fit.prior(frame, w.model);
        if exact_camera {
            prior.std[CAMERA..][..5].fill(0.0);
        }
        let posterior = fit.quadratic.posterior(&fit.state.x, &prior)?;
        let wide = at(fit, &posterior);
        let mean = ideal_mean(frame, fit, w.model, &posterior).unwrap_or_else(|| wide.clone());
        let off = &mean - &wide;
        let mut covariance = posterior.covariance();
        form_share::widen(&fit.state, fit.state.reference, &wide, &mut covariance);
        parts.push((w.probability, mean, covariance + &off * off.transpose()));
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

fn at(fit: &JointFit, posterior: &Posterior) -> DVector<f64> {
    DVector::from_fn(SIZE, |i, _| fit.state.x[i] + posterior.step[i])
}

/// Mean of a vessel that is as good as ideal, in its wall's form, its cone's place, or both, where the evidence prefers it.
fn ideal_mean(frame: &Frame, fit: &JointFit, model: Model, wide: &Posterior) -> Option<DVector<f64>> {
    let size = fit.state.size();
    let learned = fit.amplitudes.log_prior(size);
    let mut best = (wide.log_evidence + learned, None);
    for (form, cone) in [(true, true), (true, false), (false, true)] {
        let (amplitudes, own) = if form { (fit.amplitudes.ideal(size), 0.0) } else { (fit.amplitudes, learned) };
        let mut prior = prior(model, &fit.state, frame.inputs, frame.form, Some(&amplitudes));
        if cone && fit.state.has_cone {
            model.place_cone(&mut prior, size, true);
        }
        let posterior = fit.quadratic.posterior(&fit.state.x, &prior)?;
        if posterior.log_evidence + own > best.0 {
            best = (posterior.log_evidence + own, Some(at(fit, &posterior)));
        }
    }
    best.1
}

/// The averaged parameters.
#[derive(Debug, Clone)]
pub struct Average {
    /// Mean.
    pub mean: DVector<f64>,
    /// Covariance.
    pub covariance: DMatrix<f64>,
}
