//! How well a frame agrees with an answer: what its tiles pull at it, against what they and the answer leave open.

use crate::fusion::placed::Placed;
use crate::surface_fit::frame_factor::Kind;
use crate::surface_fit::joint::parameters::{INTERCEPT, OBLIQUITY, OFFSET, RADIUS, SIZE, SLOPE};
use nalgebra::{DMatrix, DVector};

/// What a frame of another place is told by: its pose and the cylinder's radius.
pub const PLACE: [usize; 5] = [0, 1, 2, 3, RADIUS];
/// What another conical surface is told by.
pub const CONE: [usize; 6] = [SLOPE, INTERCEPT, OFFSET, OFFSET + 1, OBLIQUITY, OBLIQUITY + 1];

/// Deviation up to which a frame has full weight (99 % of a normal variable); beyond √2 times this it has none.
const FULL_WEIGHT_SIGMAS: f64 = 2.58;

/// What a frame says of some parameters with all others at the answer.
#[derive(Debug, Clone)]
pub struct Distance {
    /// Squared distance in its covariance, for `dof` degrees of freedom.
    pub squared: f64,
    /// Number of parameters that it tells.
    pub dof: usize,
}

/// Squared distance of a frame from an answer with a covariance, in some parameters; `weights` tells which of its shares
/// count, `excess` by how much the frames' variances are larger than stated.
pub fn distance(
    frame: &Placed,
    weights: &[f64; 3],
    rows: &[usize],
    (covariance, excess): (&DMatrix<f64>, f64),
) -> Distance {
    let (information, gradient) = rows_of(frame, weights, rows);
    let told: Vec<usize> = (0..rows.len()).filter(|&r| information[(r, rows[r])] > 0.0).collect();
    let n = told.len();
    if n == 0 {
        return Distance { squared: 0.0, dof: 0 };
    }
    let own = DMatrix::from_fn(n, SIZE, |r, c| information[(told[r], c)]);
    let columns = own.transpose();
    let pull = DVector::from_fn(n, |r, _| gradient[told[r]]);
    let mut variance = (covariance * &columns).transpose() * columns; // few long columns take less time than many short
    for r in 0..n {
        for c in 0..n {
            variance[(r, c)] += excess * own[(r, rows[told[c]])];
        }
    }
    let scale: Vec<f64> = (0..n).map(|r| variance[(r, r)].max(1e-300).powf(-0.5)).collect();
    let unit = DMatrix::from_fn(n, n, |r, c| {
        0.5 * (variance[(r, c)] + variance[(c, r)]) * scale[r] * scale[c] + if r == c { RIDGE } else { 0.0 }
    });
    let pull = DVector::from_fn(n, |r, _| pull[r] * scale[r]);
    let squared = nalgebra::Cholesky::new(unit).map_or(f64::INFINITY, |factor| pull.dot(&factor.solve(&pull)));
    Distance { squared, dof: n }
}

const RIDGE: f64 = 1e-12;

/// Some rows of a frame's information over all parameters, and of its gradient.
pub fn rows_of(frame: &Placed, weights: &[f64; 3], rows: &[usize]) -> (DMatrix<f64>, Vec<f64>) {
    let (mut information, mut gradient) = (DMatrix::zeros(rows.len(), SIZE), vec![0.0; rows.len()]);
    for share in frame.shares.iter().filter(|share| weights[share.kind as usize] > 0.0) {
        let columns = share.kind.columns();
        for (r, row) in rows.iter().enumerate() {
            let Some(own) = columns.iter().position(|column| column == row) else { continue };
            gradient[r] += share.gradient[own];
            columns.iter().enumerate().for_each(|(c, &column)| information[(r, column)] += share.value(own, c));
        }
    }
    (information, gradient)
}

impl Distance {
    /// Where frames scatter so many times more than was stated.
    pub fn over(&self, more: f64) -> Self {
        Self { squared: self.squared / more, dof: self.dof }
    }

    /// Standard normal deviate that is as rare as the chi-square (Wilson and Hilferty's cube root).
    pub fn deviation(&self) -> f64 {
        if self.dof == 0 {
            return 0.0;
        }
        let k = self.dof as f64;
        ((self.squared / k).cbrt() - (1.0 - 2.0 / (9.0 * k))) / (2.0 / (9.0 * k)).sqrt()
    }

    /// Over the median that chi-square has.
    pub fn over_median(&self) -> f64 {
        let k = self.dof.max(1) as f64;
        self.squared / (k * (1.0 - 2.0 / (9.0 * k)).powi(3))
    }
}

/// Weight of a frame by its deviation.
pub fn redescending_weight(deviation: f64) -> f64 {
    (2.0 - (deviation.max(0.0) / FULL_WEIGHT_SIGMAS).powi(2)).clamp(0.0, 1.0)
}

/// Weights of a frame's shares by kind, from that of the frame and that of its cone.
pub fn by_kind(frame: f64, cone: f64) -> [f64; 3] {
    Kind::ALL.map(|kind| if kind == Kind::Cone { frame * cone } else { frame })
}
