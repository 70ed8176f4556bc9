//! The sum of the frames solved for every vessel model, with the form's amplitudes learned on it.

use crate::surface_fit::joint::average::{self, Average, Candidate};
use crate::surface_fit::joint::form::Form;
use crate::surface_fit::joint::model::{Amplitudes, Inputs, Model, prior};
use crate::surface_fit::joint::parameters::JointState;
use crate::surface_fit::joint::system::{Posterior, Prior, Quadratic};
use nalgebra::DMatrix;

/// How often amplitudes are learned.
const LEARNED: usize = 5;

/// A model solved.
#[derive(Debug, Clone)]
pub struct Solved {
    /// The model.
    pub model: Model,
    /// Learned widths.
    pub amplitudes: Amplitudes,
    /// ln p(frames, model), up to a constant.
    pub log_evidence: f64,
    /// The state at its mean.
    pub state: JointState,
    /// Covariance of all parameters.
    pub covariance: DMatrix<f64>,
}

/// What is solved: the sum about a state, with what was known before.
#[derive(Debug, Clone, Copy)]
pub struct System<'a> {
    /// The frames' sum of squares about the state.
    pub quadratic: &'a Quadratic,
    /// The state.
    pub state: &'a JointState,
    /// What was known before.
    pub inputs: &'a Inputs,
    /// The form's terms.
    pub form: &'a Form,
}

impl System<'_> {
    /// One model with the amplitudes that the frames show; `None` where the equations are not finite.
    pub fn solved(&self, model: Model) -> Option<Solved> {
        let mut amplitudes = Amplitudes::first(self.state.size());
        let mut posterior = self.posterior(model, &amplitudes)?;
        for _ in 0..LEARNED {
            let state = self.at(&posterior);
            amplitudes = amplitudes.learned(&state, self.form, &posterior.shrinkage(), self.inputs);
            posterior = self.posterior(model, &amplitudes)?;
        }
        Some(Solved {
            model,
            amplitudes,
            log_evidence: posterior.log_evidence + amplitudes.log_prior(self.state.size()) + model.log_prior(),
            state: self.at(&posterior),
            covariance: posterior.covariance(),
        })
    }

    /// The prior of a model with its widths.
    pub fn prior(&self, model: Model, amplitudes: &Amplitudes) -> Prior {
        prior(model, self.state, self.inputs, self.form, Some(amplitudes))
    }

    /// The covariance of a model with given widths.
    pub fn covariance(&self, model: Model, amplitudes: &Amplitudes) -> Option<DMatrix<f64>> {
        Some(self.posterior(model, amplitudes)?.covariance())
    }

    fn posterior(&self, model: Model, amplitudes: &Amplitudes) -> Option<Posterior> {
        self.quadratic.posterior(&self.state.x, &self.prior(model, amplitudes))
    }

    fn at(&self, posterior: &Posterior) -> JointState {
        let mut state = self.state.clone();
        state.add(&posterior.step, 1.0);
        state
    }

    /// The model that leaves most open.
    pub fn widest(&self) -> Model {
        Model::of(self.state).last().copied().unwrap_or(Model::Cylinder)
    }

    /// Every model of the state's parts, most probable first.
    pub fn models(&self) -> Vec<Solved> {
        let models = Model::of(self.state);
        let mut found: Vec<Solved> = models.iter().filter_map(|&model| self.solved(model)).collect();
        found.sort_by(|a, b| b.log_evidence.total_cmp(&a.log_evidence));
        found
    }

    /// Mean and covariance over the models; the form ends at the height `reference`.
    pub fn averaged(&self, models: &[(&Solved, f64)], reference: f64, exact: bool) -> Option<Average> {
        let candidate = |(solved, probability): &(&Solved, f64)| Candidate {
            model: solved.model,
            probability: *probability,
            quadratic: self.quadratic,
            state: self.state,
            amplitudes: solved.amplitudes,
            reference,
        };
        let candidates: Vec<Candidate> = models.iter().map(candidate).collect();
        average::averaged(&candidates, self.inputs, self.form, exact)
    }
}

/// Probabilities of models, in their order.
pub fn probabilities(models: &[Solved]) -> Vec<f64> {
    let most = models.iter().map(|m| m.log_evidence).fold(f64::NEG_INFINITY, f64::max);
    let weights: Vec<f64> = models.iter().map(|m| (m.log_evidence - most).exp()).collect();
    let total: f64 = weights.iter().sum();
    weights.iter().map(|w| w / total).collect()
}
