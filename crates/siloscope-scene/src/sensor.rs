//! The sensor's error model (Eqs. 8–10, and more general laws).

use crate::limits::bounded;
use siloscope::Result;

/// Error model of a depth sensor. Lengths in metres, angles in radians.
///
/// A pixel's depth is `true + bias(true) + sigma(true) · normal` (Eq. 10), then cut to the range and rounded to `unit`.
#[derive(Debug, Clone, PartialEq)]
pub struct Sensor {
    /// Bias `b0 + b1 d + b2 d²` (Eq. 8 has all three).
    pub bias: [f64; 3],
    /// Standard deviation `n0 + n1 d + n2 d²` (Eq. 9 has all three), plus the power law.
    pub noise: [f64; 3],
    /// Power law `scale · d^power` added to the standard deviation; stereo: `s/(fx·B)` and 2.
    pub noise_scale: f64,
    /// Exponent of the power law.
    pub noise_power: f64,
    /// Least standard deviation.
    pub noise_floor: f64,
    /// The standard deviation grows by the factor `1 + gain·(θ/(π/2 - θ))²` at incidence angle θ.
    pub incidence_gain: f64,
    /// Share of the variance that neighbouring pixels have in common.
    pub correlation: f64,
    /// Reach of that common part, pixels.
    pub correlation_length: f64,
    /// Lasting low-frequency warp: its standard deviation at 1 m depth; grows with the depth squared, as a stereo
    /// sensor's does.
    pub warp: f64,
    /// Distance over which the warp changes, pixels.
    pub warp_length: f64,
    /// The unit whose warp it is.
    pub warp_seed: u64,
    /// Depth added at the image's corner, growing with the squared distance from the principal point (multipath).
    pub bowl: f64,
    /// Share of the light that surfaces throw back, for what a time-of-flight sensor sees of light that goes round; 0
    /// for none of it.
    pub multipath: f64,
    /// Nearest depth measured.
    pub min_range: f64,
    /// Farthest depth measured; infinite for no limit.
    pub max_range: f64,
    /// Surfaces met at a larger incidence angle give no measurement; π/2 for no limit.
    pub max_incidence: f64,
    /// Share of pixels that give no measurement for no visible reason.
    pub dropout: f64,
    /// Size of the patches in which they are lost, pixels; below 1 for single pixels.
    pub dropout_length: f64,
    /// Distance from the projector or second imager, to the left; the band of the image that it does not see, `fx·baseline`
    /// pixels at 1 m, gives no measurement.
    pub baseline: f64,
    /// Share of pixels at depth edges that read a depth between the two sides.
    pub flying: f64,
    /// Relative depth step that makes an edge.
    pub flying_step: f64,
    /// Share of pixels that read a dust grain somewhere before the surface.
    pub dust: f64,
    /// Metres a raw unit; 0 for unrounded depths.
    pub unit: f64,
}

impl Default for Sensor {
    /// A perfect sensor.
    fn default() -> Self {
        Self {
            bias: [0.0; 3],
            noise: [0.0; 3],
            noise_scale: 0.0,
            noise_power: 2.0,
            noise_floor: 0.0,
            incidence_gain: 0.0,
            correlation: 0.0,
            correlation_length: 8.0,
            warp: 0.0,
            warp_length: 80.0,
            warp_seed: 0,
            bowl: 0.0,
            multipath: 0.0,
            min_range: 0.0,
            max_range: f64::INFINITY,
            max_incidence: std::f64::consts::FRAC_PI_2,
            dropout: 0.0,
            dropout_length: 0.0,
            baseline: 0.0,
            flying: 0.0,
            flying_step: 0.03,
            dust: 0.0,
            unit: 0.0,
        }
    }
}

impl Sensor {
    /// Checks every field by its name.
    pub fn validate(&self) -> Result<()> {
        for (name, three) in [("bias", self.bias), ("noise", self.noise)] {
            three.iter().try_for_each(|&x| bounded(name, x, -1e3, 1e3, "finite numbers between -1000 and 1000"))?;
        }
        bounded("noise_scale", self.noise_scale, 0.0, 1e3, "between 0 and 1000")?;
        bounded("noise_power", self.noise_power, 0.0, 10.0, "between 0 and 10")?;
        bounded("noise_floor", self.noise_floor, 0.0, 1e3, "between 0 and 1000 m")?;
        bounded("incidence_gain", self.incidence_gain, 0.0, 1e3, "between 0 and 1000")?;
        bounded("correlation_length", self.correlation_length, 1.0, 1e4, "between 1 and 10000 pixels")?;
        bounded("warp", self.warp, 0.0, 1.0, "between 0 and 1 m")?;
        bounded("warp_length", self.warp_length, 1.0, 1e4, "between 1 and 10000 pixels")?;
        bounded("bowl", self.bowl, -10.0, 10.0, "between -10 and 10 m")?;
        bounded("multipath", self.multipath, 0.0, 1.0, "between 0 and 1")?;
        bounded("dropout_length", self.dropout_length, 0.0, 1e4, "between 0 and 10000 pixels")?;
        bounded("baseline", self.baseline, 0.0, 10.0, "between 0 and 10 m")?;
        bounded("min_range", self.min_range, 0.0, 1e3, "between 0 and 1000 m")?;
        bounded("max_range", self.max_range, self.min_range, f64::INFINITY, "at least min_range")?;
        let right = std::f64::consts::FRAC_PI_2;
        bounded("max_incidence", self.max_incidence, 0.0, right + 1e-9, "between 0 and π/2 rad")?;
        bounded("flying_step", self.flying_step, 1e-6, 1e3, "between 0.000001 and 1000")?;
        bounded("unit", self.unit, 0.0, 1.0, "between 0 and 1 m")?;
        let shares = [
            ("correlation", self.correlation),
            ("dropout", self.dropout),
            ("flying", self.flying),
            ("dust", self.dust),
        ];
        shares.iter().try_for_each(|&(name, share)| bounded(name, share, 0.0, 1.0, "a share between 0 and 1"))
    }

    /// Mean of the error at a true depth (Eq. 8 for the Astra S).
    pub fn bias_at(&self, d: f64) -> f64 {
        self.bias[0] + d * (self.bias[1] + d * self.bias[2])
    }

    /// Standard deviation of the error at a true depth, at perpendicular incidence (Eq. 9 for the Astra S).
    pub fn sigma_at(&self, d: f64) -> f64 {
        let power = if self.noise_scale > 0.0 { self.noise_scale * d.powf(self.noise_power) } else { 0.0 };
        (self.noise[0] + d * (self.noise[1] + d * self.noise[2]) + power).max(self.noise_floor)
    }
}
