//! Robust fit of the wall to patches: Gauss–Newton steps on residuals along the rays, in units of their noise.
//!
//! A patch's residual is r = m − f(d(θ)): its measured depth m against the biased depth f of the wall's true depth d(θ)
//! on its ray. Patches that are not wall lose their weight by residual (Tukey) and by normal. Besides the sensor's
//! noise, a misfit τ of the wall itself (dents, rust, the tile's own curvature) enters every residual's variance;
//! it starts large and falls to what the agreeing patches need.

use crate::Vec3;
use crate::geometry::evaluator::{ImplicitSample, SurfaceEvaluator};
use crate::geometry::parameters::{Information, OVALITY, PARAMETERS, Parameters};
use crate::geometry::sensor::{DepthBias, NoiseLaw};
use crate::geometry::surface::{Cone, Part, SiloSurface};
use crate::stats::robust::{MAD_TO_STD, upper_median};
pub use crate::surface_fit::equation::{Equation, tukey, tukey_slope};
use crate::surface_fit::tiles::Patches;

/// What is known before the frame is looked at.
#[derive(Debug, Clone)]
pub struct Prior {
    /// Expected depth bias.
    pub bias: DepthBias,
    /// Its standard deviations (offset, scale, quadratic); zero pins a value.
    pub bias_std: [f64; 3],
    /// Known radius and its standard deviation, metres.
    pub radius: Option<(f64, f64)>,
    /// Direction of gravity in the camera frame and its standard deviation, radians.
    pub gravity: Option<(Vec3, f64)>,
    /// Standard deviation of the ovality's two parts; zero for a round silo.
    pub ovality_std: f64,
}

/// Standard deviation of each part of a real silo's ovality.
pub const OVALITY_STD: f64 = 0.005;

impl Prior {
    /// The same for a silo that may be oval.
    pub fn with_ovality(&self) -> Self {
        Self { ovality_std: OVALITY_STD, ..self.clone() }
    }
}

/// State of the fit.
#[derive(Debug, Clone)]
pub struct Fit {
    /// The wall.
    pub surface: SiloSurface,
    /// The depth bias.
    pub bias: DepthBias,
    /// Whether the wall is seen from inside.
    pub inside: bool,
    /// Misfit of the wall beside the sensor's noise, metres across the wall.
    pub misfit: f64,
    /// Weight of each patch, 0 to 1.
    pub weights: Vec<f64>,
}

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

    /// The equation of patch `i` with its residual left at the distance of the depth `d` from the wall.
    ///
    /// With d on the wall, neither the derivative nor the variance depends on the noise of the patch itself. That
    /// matters: a derivative that carries the residual's own noise pulls the answer along weakly determined directions.
    pub fn equation_at(&self, fit: &Fit, placed: &SurfaceEvaluator, i: usize, d: f64) -> Option<Equation> {
        self.contact_at(fit, placed, i, d).map(|contact| self.equation_of(placed, &contact))
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

impl Fit {
    /// Adds a step of the fit, shortened where it goes too far.
    pub fn apply(&mut self, step: &Parameters) {
        let shrink = |value: f64, share: f64, of: f64| value.clamp(-share * of, share * of);
        let mut step = *step;
        let reach = self.surface.radius.or(self.surface.cone.map(|c| c.intercept())).unwrap_or(1.0).abs();
        for k in 0..2 {
            step[k] = shrink(step[k], 0.2, 1.0);
        }
        for k in 2..=4 {
            step[k] = shrink(step[k], 0.3, reach);
        }
        if let Some(cone) = self.surface.cone {
            // far from the answer a cone's vertex is surer than its radius at the camera's height
            let slope = cone.slope + shrink(step[5], 0.3, cone.slope);
            let apex = cone.apex + shrink((step[6] - cone.apex * step[5]) / cone.slope, 0.3, reach);
            (step[5], step[6]) = (slope - cone.slope, slope * apex - cone.intercept());
        }
        self.surface = self.surface.stepped(&step);
        self.bias = self.bias.stepped(&step);
    }
}

impl Fit {
    /// Gives the cylinder a known radius by scaling every length, and the depth bias so that nothing measured changes.
    pub fn rescale_to(&mut self, radius: f64) {
        let Some(now) = self.surface.radius else { return };
        let factor = radius / now;
        let SiloSurface { pose, cone, .. } = self.surface;
        self.surface = SiloSurface {
            ovality: self.surface.ovality,
            pose: crate::SiloPose { t_x: pose.t_x * factor, t_y: pose.t_y * factor, ..pose },
            radius: Some(radius),
            cone: cone.map(|c| Cone { apex: c.apex * factor, ..c }),
        };
        self.bias.scale = (1.0 + self.bias.scale) / factor - 1.0;
        self.bias.quadratic /= factor * factor;
    }
}

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

    /// The same with ovality among the parameters; for a fit that took the silo for round, or had it already.
    pub fn with_ovality(mut self, std: f64) -> Self {
        for k in [OVALITY, OVALITY + 1] {
            if self.prior[(k, k)] == 0.0 {
                self.add_prior(k, 0.0, std);
            }
        }
        self
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
    fn add_leading<const N: usize>(&mut self, jacobian: &Parameters, residual: f64, information: f64) {
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

    /// Covariance of the free parameters (zero rows elsewhere), and which are free.
    pub fn covariance(&self, fit: &Fit) -> Option<(Information, [bool; PARAMETERS])> {
        let (h, scale, free) = self.scaled(fit);
        let mut covariance = h.cholesky()?.inverse();
        for k in 0..PARAMETERS {
            for l in 0..PARAMETERS {
                covariance[(k, l)] *= if free[k] && free[l] { scale[k] * scale[l] } else { 0.0 };
            }
        }
        Some((covariance, free))
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
