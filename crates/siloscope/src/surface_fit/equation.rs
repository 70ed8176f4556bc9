//! Linear equations of patches and of tiles of pixels: what the solvers add up.

use crate::geometry::parameters::Parameters;
use crate::geometry::surface::Part;
use crate::stats::robust;

/// Tukey's weight for a squared residual in units of its variance.
#[inline]
pub fn tukey(squared: f64) -> f64 {
    robust::tukey_weight(squared, robust::TUKEY)
}

/// Derivative of residual × weight by the residual, for a squared residual in units of its variance.
#[inline]
pub fn tukey_slope(squared: f64) -> f64 {
    robust::tukey_slope(squared, robust::TUKEY)
}

/// One patch's equation.
#[derive(Debug, Clone, Copy)]
pub struct Equation {
    /// Residual along the ray, metres.
    pub residual: f64,
    /// Derivative of the residual.
    pub jacobian: Parameters,
    /// Variance of the residual: noise of the mean and misfit.
    pub variance: f64,
    /// Cosine between the ray and the wall's normal: residual × cosine is the distance from the wall.
    pub cosine: f64,
    /// Part of the wall.
    pub part: Part,
    /// Height in the silo frame.
    pub z: f64,
    /// Position across the axis: x and y in the silo frame.
    pub across: [f64; 2],
}

/// The equation of one wall tile from its pixels.
#[derive(Debug, Clone, Copy)]
pub struct TileEquation {
    /// Index of the patch.
    pub patch: usize,
    /// Its equation.
    pub equation: Equation,
    /// Variance of the residual by the noise alone.
    pub noise: f64,
    /// How far the residual may be off along this ray, as a multiple of the fit's misfit.
    pub spread: f64,
}

impl TileEquation {
    /// How much the tile pulls at the answer: its weighted residual in units of its variance.
    pub fn pull(&self) -> f64 {
        let Equation { residual, variance, .. } = self.equation;
        tukey(residual * residual / variance) * residual / variance
    }

    /// Puts a misfit into the variance.
    pub fn allow(&mut self, misfit: f64) {
        let along = misfit * self.spread;
        self.equation.variance = self.noise + along * along;
    }
}
