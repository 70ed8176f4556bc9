//! What one frame alone says about all parameters of the joint fit, without priors, in a form that adds up over frames.
//!
//! Near the state θ₀ a frame's negative log-likelihood is Σ (½ δᵀHδ + gᵀδ), δ = θ − θ₀, over its shares. The tiles of the
//! cylinder and those of the cone are shares of their own: what comes back in every frame can be weighed by the part.

use crate::geometry::parameters::{Information, OVALITY, PARAMETERS, Parameters};
use crate::surface_fit::joint::model::{Inputs, Model};
use crate::surface_fit::joint::parameters::{
    BIAS, COMMON, CYLINDER_END, INTERCEPT, JointState, OVAL_COLUMN, RADIUS, SIZE, SLOPE,
};

/// Rays that a frame keeps of each part.
pub const RAYS: usize = 32;

/// A ray (x, y, 1) of the camera frame and its information, 1/m²; none where that is 0.
pub type Ray = [f64; 3];

/// What one frame alone says.
#[derive(Debug, Clone)]
pub struct FrameFactor {
    /// Linearisation point θ₀.
    pub state: JointState,
    /// The frame's own most probable model.
    pub model: Model,
    /// Whether the frame knows that its cone is the silo's own.
    pub hopper: bool,
    /// What its tiles say.
    pub shares: Vec<Share>,
    /// What was known before the frame.
    pub known: Inputs,
    /// Standard deviation of the depth scale where no frame can tell it, else 0.
    pub scale_std: f64,
    /// Some of its rays, to tell what it says of walls far from θ₀; none where the depth bias is known.
    pub rays: Vec<Ray>,
}

/// What some of the tiles say, in the columns that they have.
#[derive(Debug, Clone, PartialEq)]
pub struct Share {
    /// Which tiles.
    pub kind: Kind,
    /// H, row by row; already divided by the tiles' correlation within the frame.
    pub information: Vec<f64>,
    /// g at the linearisation point.
    pub gradient: Vec<f64>,
    /// Fraction of g's variance that the sensor's noise makes: new in every frame.
    pub sensor_fraction: f64,
    /// Fraction of the frame's tiles.
    pub seen: f64,
}

/// Which tiles a share has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Those of the cylinder.
    Cylinder,
    /// Those of the cone.
    Cone,
    /// All tiles, in the twelve parameters of a coaxial vessel without form: clouds, and views from outside.
    Whole,
}

impl Kind {
    /// Every kind.
    pub const ALL: [Self; 3] = [Self::Cylinder, Self::Cone, Self::Whole];

    /// Stable name.
    pub fn slug(self) -> &'static str {
        match self {
            Self::Cylinder => "cylinder",
            Self::Cone => "cone",
            Self::Whole => "whole",
        }
    }

    /// Which of all parameters the share's columns are.
    pub fn columns(self) -> &'static [usize] {
        match self {
            Self::Cylinder => &CYLINDER_COLUMNS,
            Self::Cone => &CONE_COLUMNS,
            Self::Whole => &COAXIAL_COLUMNS,
        }
    }
}

const CYLINDER_COLUMNS: [usize; CYLINDER_END] = {
    let mut columns = [0; CYLINDER_END];
    let mut k = 0;
    while k < CYLINDER_END {
        columns[k] = k;
        k += 1;
    }
    columns
};

const CONE_COLUMNS: [usize; COMMON + SIZE - SLOPE] = {
    let mut columns = [0; COMMON + SIZE - SLOPE];
    let mut k = 0;
    while k < columns.len() {
        columns[k] = if k < COMMON { k } else { SLOPE + k - COMMON };
        k += 1;
    }
    columns
};

/// The twelve parameters of a coaxial vessel among all, ovality as lengths.
pub const COAXIAL_COLUMNS: [usize; PARAMETERS] =
    [0, 1, 2, 3, RADIUS, SLOPE, INTERCEPT, BIAS, BIAS + 1, BIAS + 2, OVAL_COLUMN, OVAL_COLUMN + 1];

impl Share {
    /// H in a row and column.
    pub fn value(&self, row: usize, column: usize) -> f64 {
        self.information[row * self.gradient.len() + column]
    }

    /// The gradient after a step: g + Hδ.
    pub fn gradient_after(&self, step: &[f64]) -> Vec<f64> {
        let rows = self.information.chunks_exact(step.len().max(1));
        self.gradient
            .iter()
            .zip(rows)
            .map(|(g, row)| g + row.iter().zip(step).map(|(h, s)| h * s).sum::<f64>())
            .collect()
    }
}

/// The share of a frame in twelve parameters whose answer has a covariance beyond what its equations' noise makes.
///
/// Information Λ and gradient g are those of its equations, `scatter` S is g's covariance as the residuals have it,
/// `noise` the sensor's part of it: the information that states the covariance is Λ S⁻¹ Λ.
pub fn whole_share(
    (information, gradient): (&Information, &Parameters),
    (scatter, noise): (&Information, &Information),
    free: &[bool; PARAMETERS],
    (radius, seen): (f64, f64),
) -> Share {
    let scale = Parameters::from_fn(|k, _| if scatter[(k, k)] > 0.0 { scatter[(k, k)].powf(-0.5) } else { 0.0 });
    let unit = |ridge: f64| {
        scatter.map_with_location(|r, c, v| {
            let both = free[r] && free[c] && scale[r] > 0.0 && scale[c] > 0.0;
            let one = if r == c { if both { ridge } else { 1.0 } } else { 0.0 };
            one + if both { v * scale[r] * scale[c] } else { 0.0 }
        })
    };
    let scaled = Information::from_fn(|r, c| if free[r] && free[c] { scale[r] * information[(r, c)] } else { 0.0 });
    let spread = RIDGES.into_iter().find_map(|ridge| nalgebra::Cholesky::new(unit(ridge)));
    let stated = spread.map_or_else(Information::zeros, |spread| scaled.transpose() * spread.solve(&scaled));
    let fraction = (0..4).filter(|&k| scatter[(k, k)] > 0.0).map(|k| noise[(k, k)] / scatter[(k, k)]);
    let length = |k: usize| if k >= OVALITY { 1.0 / radius } else { 1.0 };
    let values =
        |k: usize| (0..PARAMETERS).map(move |c| 0.5 * (stated[(k, c)] + stated[(c, k)]) * length(k) * length(c));
    Share {
        kind: Kind::Whole,
        information: (0..PARAMETERS).flat_map(values).collect(),
        gradient: (0..PARAMETERS).map(|k| if free[k] { gradient[k] * length(k) } else { 0.0 }).collect(),
        sensor_fraction: fraction.fold(1.0, f64::min),
        seen,
    }
}

/// Of a unit diagonal: keeps directions in which nothing scatters from being divided by 0; the first that does.
const RIDGES: [f64; 4] = [1e-12, 1e-9, 1e-6, 1e-3];

/// The rows and columns of the free parameters; zero elsewhere.
pub fn restrict(m: &Information, free: &[bool; PARAMETERS]) -> Information {
    m.map_with_location(|r, c, v| if free[r] && free[c] { v } else { 0.0 })
}
