//! Normal equations of the fit: priors, equations, the Gauss–Newton step and the covariance.

use crate::Vec3;
use crate::geometry::parameters::{Information, OVALITY, PARAMETERS, Parameters};
use crate::surface_fit::equation::Equation;
use crate::surface_fit::state::{Fit, Prior};

/// Normal equations H·step = −g.
#[derive(Debug, Clone)]
pub struct System {
    /// Information H from the frame and the prior; only the lower triangle is kept.
    pub information: Information,
    /// Gradient g.
    pub gradient: Parameters,
    /// The prior's share of H.
    pub prior: Information,
}

impl System {
    /// No information.
    pub fn empty() -> Self {
        Self { information: Information::zeros(), gradient: Parameters::zeros(), prior: Information::zeros() }
    }

    /// The prior alone, seen from the fit's present state.
    pub fn with_prior(prior: &Prior, fit: &Fit) -> Self {
        let mut system = Self::empty();
        let now = [fit.bias.offset, fit.bias.scale, fit.bias.quadratic];
        let expected = [prior.bias.offset, prior.bias.scale, prior.bias.quadratic];
        for k in 0..3 {
            if prior.bias_std[k] > 0.0 {
                system.add_prior(7 + k, now[k] - expected[k], prior.bias_std[k]);
            }
        }
        if prior.ovality_std > 0.0 {
            system.add_prior(OVALITY, fit.surface.ovality[0], prior.ovality_std);
            system.add_prior(OVALITY + 1, fit.surface.ovality[1], prior.ovality_std);
        }
        if let (Some((radius, std)), Some(now)) = (prior.radius, fit.surface.radius) {
            system.add_prior(4, now - radius, std);
        }
        if let Some((gravity, std)) = prior.gravity {
            let expected = crate::SiloPose::from_axis(&gravity, &Vec3::zeros());
            let pose = &fit.surface.pose;
            system.add_prior(0, pose.r_x - expected.r_x, std / pose.r_y.cos().max(1e-3));
            system.add_prior(1, pose.r_y - expected.r_y, std);
        }
        system
    }

    /// Without what the frame says.
    pub fn prior_alone(&self) -> Self {
        Self { information: self.prior, gradient: Parameters::zeros(), prior: self.prior }
    }

    fn add_prior(&mut self, k: usize, residual: f64, std: f64) {
        let information = 1.0 / (std * std);
        self.prior[(k, k)] += information;
        self.information[(k, k)] += information;
        self.gradient[k] += information * residual;
    }

    /// Adds an equation with a robust weight.
    #[inline]
    pub fn add(&mut self, equation: &Equation, weight: f64) {
        self.add_row(&equation.jacobian, equation.residual, weight / equation.variance);
    }

    /// Adds a residual with its derivative and its information.
    #[inline]
    pub fn add_row(&mut self, jacobian: &Parameters, residual: f64, information: f64) {
        self.add_leading::<PARAMETERS>(jacobian, residual, information);
    }

    /// The same for the first N parameters alone.
    #[inline(always)]
    pub fn add_leading<const N: usize>(&mut self, jacobian: &Parameters, residual: f64, information: f64) {
        let j: &[f64; PARAMETERS] = &jacobian.data.0[0];
        let h: &mut [[f64; PARAMETERS]; PARAMETERS] = &mut self.information.data.0;
        let g: &mut [f64; PARAMETERS] = &mut self.gradient.data.0[0];
        for k in 0..N {
            let factor = information * j[k];
            for l in k..N {
                h[k][l] += factor * j[l];
            }
            g[k] += factor * residual;
        }
    }

    /// H with unit information on the parameters that are not free, scaled to a unit diagonal; the scale; who is free.
    fn scaled(&self, fit: &Fit) -> (Information, Parameters, [bool; PARAMETERS]) {
        let mut h = self.information;
        let free = free_parameters(fit, &self.prior);
        let mut scale = Parameters::zeros();
        for k in 0..PARAMETERS {
            if !free[k] {
                h.row_mut(k).fill(0.0);
                h.column_mut(k).fill(0.0);
                h[(k, k)] = 1.0;
            }
            scale[k] = if h[(k, k)] > 0.0 { 1.0 / h[(k, k)].sqrt() } else { 1.0 };
        }
        for k in 0..PARAMETERS {
            for l in 0..PARAMETERS {
                h[(k, l)] *= scale[k] * scale[l];
            }
        }
        (h, scale, free)
    }

    /// The Gauss–Newton step; `None` where the equations don't fix it.
    pub fn solve(&self, fit: &Fit) -> Option<Parameters> {
        let (mut h, scale, free) = self.scaled(fit);
        let mut g = self.gradient.component_mul(&scale);
        for k in 0..PARAMETERS {
            h[(k, k)] *= 1.0 + 1e-10;
            if !free[k] {
                g[k] = 0.0;
            }
        }
        let step = -h.cholesky()?.solve(&g).component_mul(&scale);
        step.iter().all(|s| s.is_finite()).then_some(step)
    }

    /// Covariance of the free parameters; zero rows elsewhere.
    pub fn covariance(&self, fit: &Fit) -> Option<Information> {
        let (h, scale, free) = self.scaled(fit);
        let mut covariance = h.cholesky()?.inverse();
        for k in 0..PARAMETERS {
            for l in 0..PARAMETERS {
                covariance[(k, l)] *= if free[k] && free[l] { scale[k] * scale[l] } else { 0.0 };
            }
        }
        Some(covariance)
    }
}

/// Which parameters the fit estimates: parts that are there, and bias terms with a prior.
///
/// The depth scale can't be told from the silo's size: it is free only where the radius is known and seen.
pub fn free_parameters(fit: &Fit, prior: &Information) -> [bool; PARAMETERS] {
    let (cylinder, cone) = (fit.surface.radius.is_some(), fit.surface.cone.is_some());
    let known = |k: usize| prior[(k, k)] > 0.0;
    let oval = [known(OVALITY), known(OVALITY + 1)];
    [true, true, true, true, cylinder, cone, cone, known(7), known(8) && known(4), known(9), oval[0], oval[1]]
}
