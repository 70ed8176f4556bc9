//! Robust fit of the wall to patches: Gauss–Newton steps on residuals along the rays, in units of their noise.
//!
//! A patch's residual is r = m − f(d(θ)): its measured depth m against the biased depth f of the wall's true depth d(θ)
//! on its ray. Patches that are not wall lose their weight by residual (Tukey) and by normal. Besides the sensor's
//! noise, a misfit τ of the wall itself (dents, rust, the tile's own curvature) enters every residual's variance;
//! it starts large and falls to what the agreeing patches need.

use crate::Vec3;
use crate::geometry::evaluator::{ImplicitSample, SurfaceEvaluator};
use crate::geometry::sensor::NoiseLaw;
use crate::geometry::surface::Part;
use crate::stats::robust::{MAD_TO_STD, upper_median};
pub use crate::surface_fit::equation::{Equation, tukey, tukey_slope};
pub use crate::surface_fit::normal_equations::{System, free_parameters};
pub use crate::surface_fit::state::{Fit, OVALITY_STD, Prior};
use crate::surface_fit::tiles::Patches;

/// Everything that stays the same during a fit.
#[derive(Debug, Clone, Copy)]
pub struct Problem<'a> {
    /// The patches.
    pub patches: &'a Patches,
    /// Noise of a single measurement.
    pub noise: NoiseLaw,
    /// Prior knowledge.
    pub prior: &'a Prior,
    /// Size of a pixel at depth 1.
    pub pixel: f64,
}

/// The first so many parameters are those of a round silo, without the depth bias.
const SURFACE: usize = 7;

/// Smallest misfit assumed, metres: what rounding in the tiles' own means amounts to.
const MISFIT_FLOOR: f64 = 2e-4;

/// A patch held against the wall: what its weight asks for, and what its equation is made of.
#[derive(Debug, Clone, Copy)]
pub struct Contact {
    /// Residual along the ray, metres.
    pub residual: f64,
    /// Variance of the residual: noise of the mean and misfit.
    pub variance: f64,
    /// Cosine between the ray and the wall's normal: residual × cosine is the distance from the wall.
    pub cosine: f64,
    /// Part of the wall.
    pub part: Part,
    /// Depth of the wall where the derivative is taken, and the point there, camera frame.
    d: f64,
    p: Vec3,
    at: ImplicitSample,
    /// Change of the residual per change of the implicit function.
    rate: f64,
}

impl Contact {
    /// Variance of the residual by the noise alone.
    pub fn noise(&self, fit: &Fit) -> f64 {
        let misfit = fit.misfit / self.cosine;
        (self.variance - misfit * misfit).max(0.0)
    }
}

impl Problem<'_> {
    /// Patch `i` against the wall; `None` where its ray runs along the wall or it straddles the joint.
    #[inline(always)]
    pub fn contact(&self, fit: &Fit, placed: &SurfaceEvaluator, i: usize) -> Option<Contact> {
        let measured = self.patches.list[i].measured;
        self.contact_at(fit, placed, i, if self.patches.cloud { 0.0 } else { fit.bias.true_depth(measured) })
    }

    #[inline(always)]
    fn contact_at(&self, fit: &Fit, placed: &SurfaceEvaluator, i: usize, d: f64) -> Option<Contact> {
        let patch = &self.patches.list[i];
        let cloud = self.patches.cloud;
        let turned = placed.turn(&patch.q);
        let at = if cloud { placed.local(&patch.origin) } else { placed.local_along(&turned, d) };
        let q = if cloud { at.gradient.normalize() } else { turned };
        let along = at.gradient.dot(&q);
        let (full, inverse) = ((at.gradient.norm_squared() * q.norm_squared()).sqrt(), 1.0 / along);
        let cosine = along / full;
        let half = 0.5 * self.pixel * self.patches.side as f64 * d; // of the tile, before it is stretched by 1/cosine
        if cosine.is_nan() || cosine.abs() < 0.02 || (at.p.z - placed.bottom()).abs() * cosine.abs() < half {
            return None;
        }
        let rate = (if cloud { 1.0 } else { fit.bias.slope(d) }) * inverse;
        let sigma = if cloud { patch.scatter } else { self.noise.sigma(d) };
        let misfit = fit.misfit * full * inverse;
        let variance = sigma * sigma / patch.count + misfit * misfit;
        let cosine = cosine.abs();
        Some(Contact { residual: rate * at.value, variance, cosine, part: at.part, d, p: patch.at(d), at, rate })
    }

    /// The equation of patch `i`; `None` where its ray runs along the wall or it straddles the joint.
    pub fn equation(&self, fit: &Fit, placed: &SurfaceEvaluator, i: usize) -> Option<Equation> {
        self.contact(fit, placed, i).map(|contact| self.equation_of(placed, &contact))
    }

    /// The equation of a contact, with its derivative on the wall where the depth bias is free.
    ///
    /// The bias trades against the pose along a weak direction, in which the noise in derivatives outweighs the frame.
    #[inline(always)]
    pub fn stable_equation(&self, fit: &Fit, placed: &SurfaceEvaluator, contact: &Contact, i: usize) -> Equation {
        if self.patches.cloud || self.prior.bias_std[2] == 0.0 {
            return self.equation_of(placed, contact);
        }
        let d = contact.d - contact.residual / fit.bias.slope(contact.d); // a Newton step along the ray to the wall
        let on_wall = self.contact_at(fit, placed, i, d).unwrap_or(*contact);
        let Contact { residual, variance, .. } = *contact;
        self.equation_of(placed, &Contact { residual, variance, ..on_wall })
    }

    #[inline]
    fn equation_of(&self, placed: &SurfaceEvaluator, contact: &Contact) -> Equation {
        let Contact { residual, variance, cosine, part, d, p, at, rate, .. } = *contact;
        let mut jacobian = placed.derivative(&p, &at) * rate;
        if !self.patches.cloud {
            jacobian[7] = -1.0;
            jacobian[8] = -d;
            jacobian[9] = -d * d;
        }
        Equation { residual, jacobian, variance, cosine, part, z: at.p.z, across: [at.p.x, at.p.y] }
    }

    /// Robust weight of patch `i`: by residual and by normal, which may be `angle` off beside its own uncertainty.
    #[inline]
    pub fn weight(&self, fit: &Fit, placed: &SurfaceEvaluator, contact: &Contact, i: usize, angle: f64) -> f64 {
        let patch = &self.patches.list[i];
        let by_residual = tukey(contact.residual * contact.residual / contact.variance);
        if by_residual <= 0.0 || !patch.smooth {
            return 0.0;
        }
        by_residual * self.agreement(fit, placed, contact, i, angle)
    }

    /// Robust weight of patch `i` by its normal alone, 0 to 1.
    #[inline(always)]
    pub fn agreement(&self, fit: &Fit, placed: &SurfaceEvaluator, contact: &Contact, i: usize, angle: f64) -> f64 {
        let patch = &self.patches.list[i];
        let facing = placed.turn(&patch.normal).dot(&contact.at.gradient) / contact.at.gradient.norm();
        let agreement = match (self.patches.cloud, fit.inside) {
            (true, _) => facing.abs(),
            (false, true) => -facing,
            (false, false) => facing,
        };
        let limit = angle + 3.0 * patch.sigma_normal;
        let by_normal = 1.0 - 2.0 * (1.0 - agreement) / (limit * limit); // the squared angle is 2·(1 − cosine)
        by_normal.clamp(0.0, 0.5) * 2.0
    }

    /// Runs `rounds` Gauss–Newton steps over every `stride`-th patch; `angle` is the tolerated angle between normals.
    pub fn refine(&self, fit: &mut Fit, rounds: usize, stride: usize, angle: f64) {
        for _ in 0..rounds {
            self.step(fit, stride, angle);
        }
    }

    fn step(&self, fit: &mut Fit, stride: usize, angle: f64) {
        let placed = SurfaceEvaluator::new(fit.surface);
        let mut system = System::with_prior(self.prior, fit);
        let bias_is_pinned = self.prior.bias_std == [0.0; 3] && self.prior.ovality_std == 0.0;
        let mut across: Vec<f64> = Vec::with_capacity(self.patches.list.len() / stride + 1);
        let (mut cylinder, mut cone, mut noise) = (0.0, 0.0, 0.0);
        fit.weights.iter_mut().for_each(|w| *w = 0.0);
        for i in (0..self.patches.list.len()).step_by(stride) {
            let Some(contact) = self.contact(fit, &placed, i) else { continue };
            let weight = self.weight(fit, &placed, &contact, i, angle);
            if weight <= 0.0 {
                continue;
            }
            fit.weights[i] = weight;
            let equation = self.stable_equation(fit, &placed, &contact, i);
            if bias_is_pinned {
                system.add_leading::<SURFACE>(&equation.jacobian, equation.residual, weight / equation.variance);
            } else {
                system.add(&equation, weight);
            }
            let Contact { residual, variance, cosine, part, .. } = contact;
            across.push((residual * cosine).abs());
            noise += (variance * cosine * cosine - fit.misfit * fit.misfit).max(0.0);
            *(if part == Part::Cylinder { &mut cylinder } else { &mut cone }) += weight;
        }
        let noise = noise / (across.len().max(1)) as f64;
        if let Some(step) = system.solve(fit) {
            fit.apply(&step);
        }
        fit.misfit = next_misfit(fit.misfit, &mut across, noise);
        let few = 6.0 / stride as f64;
        if cone < few && fit.surface.radius.is_some() {
            fit.surface.cone = None;
        } else if cylinder < few && fit.surface.cone.is_some() {
            fit.surface.radius = None;
        }
    }
}

/// What the agreeing patches' distances from the wall need beside the noise; at most halves in one step.
fn next_misfit(now: f64, across: &mut [f64], noise: f64) -> f64 {
    let Some(median) = upper_median(across) else { return now };
    let spread = MAD_TO_STD * median;
    (spread * spread - noise).max(0.0).sqrt().clamp(now * 0.4, now).max(MISFIT_FLOOR)
}
