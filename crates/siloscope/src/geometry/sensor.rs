//! What a depth sensor does to a true depth: systematic error and noise (Eqs. 8–10).

use crate::geometry::parameters::{BIAS, Parameters, SCALE};

/// Systematic depth error: measured = d + offset + scale·d + quadratic·d², d the true depth in metres (Eq. 10).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct DepthBias {
    /// Constant part, metres.
    pub offset: f64,
    /// Share of the depth, dimensionless.
    pub scale: f64,
    /// Quadratic part, 1/metre.
    pub quadratic: f64,
}

impl DepthBias {
    /// The bias of parameters.
    pub fn of_parameters(p: &Parameters) -> Self {
        Self { offset: p[BIAS.start], scale: p[SCALE], quadratic: p[BIAS.end - 1] }
    }

    /// Adds the depth bias's part of a step of the fit.
    pub fn stepped(&self, step: &Parameters) -> Self {
        let by = Self::of_parameters(step);
        Self { offset: self.offset + by.offset, scale: self.scale + by.scale, quadratic: self.quadratic + by.quadratic }
    }

    /// The measured depth of a true depth, without noise.
    #[inline]
    pub fn measured(&self, d: f64) -> f64 {
        d + self.offset + d * (self.scale + d * self.quadratic)
    }

    /// Derivative of `measured` with respect to the true depth.
    #[inline]
    pub fn slope(&self, d: f64) -> f64 {
        1.0 + self.scale + 2.0 * d * self.quadratic
    }

    /// The true depth of a noise-free measured depth; NaN where no depth measures so.
    #[inline]
    pub fn true_depth(&self, measured: f64) -> f64 {
        let linear = 1.0 + self.scale;
        let rest = measured - self.offset;
        2.0 * rest / (linear + (linear * linear + 4.0 * self.quadratic * rest).sqrt())
    }
}

/// Standard deviation of the depth noise at a true depth d, in metres:
/// the larger of `floor` and `constant + linear·d + quadratic·d² + power_factor·d^power`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NoiseLaw {
    /// Smallest standard deviation, metres.
    pub floor: f64,
    /// Constant part, metres.
    pub constant: f64,
    /// Linear part, dimensionless.
    pub linear: f64,
    /// Quadratic part, 1/metre.
    pub quadratic: f64,
    /// Factor of the power law, metres^(1-power).
    pub power_factor: f64,
    /// Exponent of the power law.
    pub power: f64,
}

impl NoiseLaw {
    /// The same standard deviation at every depth.
    pub fn uniform(sigma: f64) -> Self {
        Self { floor: sigma, constant: 0.0, linear: 0.0, quadratic: 0.0, power_factor: 0.0, power: 1.0 }
    }

    /// Standard deviation at the true depth `d`, metres.
    #[inline]
    pub fn sigma(&self, d: f64) -> f64 {
        let law = self.constant + d * (self.linear + d * self.quadratic);
        let power = if self.power_factor == 0.0 { 0.0 } else { self.power_factor * d.abs().powf(self.power) };
        (law + power).max(self.floor)
    }
}

/// Everything known about a sensor's depth error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DepthError {
    /// Systematic part.
    pub bias: DepthBias,
    /// Standard deviations of what is not known about `bias`: offset, scale, quadratic. Zero where it is exact.
    pub bias_std: [f64; 3],
    /// Random part; `None` where it has to be estimated from the frame itself.
    pub noise: Option<NoiseLaw>,
}

impl DepthError {
    /// A sensor of which nothing is known: no bias, with weak priors on it, and unknown noise.
    pub fn unknown() -> Self {
        Self { bias: DepthBias::default(), bias_std: [0.01, 0.02, 0.02], noise: None }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Eqs. 8 and 9 in metres.
    fn astra_s() -> (DepthBias, NoiseLaw) {
        let noise = 1e-3 / 12f64.sqrt();
        (
            DepthBias { offset: 3.4397e-3, scale: -0.017878, quadratic: 2.2093e-2 },
            NoiseLaw {
                floor: 0.0,
                constant: 0.5 * noise,
                linear: -0.5 * noise,
                quadratic: 3.0 * noise,
                power_factor: 0.0,
                power: 1.0,
            },
        )
    }

    #[test]
    fn bias_and_its_inverse_agree() {
        let (bias, _) = astra_s();
        for d in [0.3, 1.0, 2.5, 5.0, 8.0] {
            assert!((bias.true_depth(bias.measured(d)) - d).abs() < 1e-13);
            let h = 1e-6;
            assert!((bias.slope(d) - (bias.measured(d + h) - bias.measured(d - h)) / (2.0 * h)).abs() < 1e-8);
        }
        let plain = DepthBias { offset: 0.01, scale: -0.02, quadratic: 0.0 };
        assert!((plain.true_depth(plain.measured(3.0)) - 3.0).abs() < 1e-14);
    }

    #[test]
    fn equations_8_and_9_at_five_metres() {
        let (bias, noise) = astra_s();
        let s = 2.2093e-5 * 5000.0 * 5000.0 - 0.017878 * 5000.0 + 3.4397;
        assert!((bias.measured(5.0) - 5.0 - s * 1e-3).abs() < 1e-12);
        let r = (3e-6 * 5000.0 * 5000.0 - 5e-4 * 5000.0 + 0.5) / (2.0 * 3f64.sqrt());
        assert!((noise.sigma(5.0) - r * 1e-3).abs() < 1e-12);
    }
}
