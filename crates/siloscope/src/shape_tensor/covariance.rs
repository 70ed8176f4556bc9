//! How sure the six steps' axis is: from how much blocks of neighbouring points disagree.
//!
//! Neighbouring points share their neighbours, so their errors go together. Sums over blocks larger than those
//! neighbourhoods count as independent (a cluster-robust sandwich). What moves all points alike, such as a depth bias,
//! can't be seen this way and is not in the covariance.

use crate::base::refusal::Refusal;
use crate::shape_tensor::axis::AxisPoint;
use crate::stats::blocks::sums;
use crate::{SiloPose, Vec3};
use nalgebra::{Matrix2, Matrix4, Matrix4x2, Vector2};

/// Fewest blocks from which a scatter is estimated.
const MIN_BLOCKS: usize = 6;
/// Largest standard deviation of the direction that still is an answer, radians.
const MAX_TILT_STD: f64 = 0.05;

/// Stride over the estimated axis points: they are many, and the blocks behind them few. Prime, so that it shares no
/// factor with the usual numbers of partners.
const STRIDE: usize = 7;
/// Half-width of the window around the inlier limit, as a fraction of the limit.
const LIMIT_WINDOW: f64 = 0.25;

/// What the covariance is drawn from.
pub struct Scatter<'a> {
    /// The pose found.
    pub pose: &'a SiloPose,
    /// E1 of the walls, in the silo frame.
    pub e1: &'a [Vec3],
    /// Estimated axis points.
    pub estimates: &'a [AxisPoint],
    /// Block of each wall, and the number of blocks.
    pub block: &'a [usize],
    /// Number of blocks.
    pub blocks: usize,
    /// Mean z of the walls in the silo frame: there, direction and position of the axis are independent.
    pub height: f64,
    /// E1 of all candidates, in the silo frame.
    pub candidates: &'a [Vec3],
    /// Largest |E1·X| of the walls among them.
    pub limit: f64,
}

impl Scatter<'_> {
    /// Covariance of r_x, r_y, t_x and t_y; none where the direction is hardly determined.
    pub fn covariance(&self) -> Result<Matrix4<f64>, Refusal> {
        let covariance = self.sandwiches();
        let std = covariance.diagonal().map(f64::sqrt);
        let determined = self.blocks >= MIN_BLOCKS && std.x < MAX_TILT_STD && std.y < MAX_TILT_STD;
        if determined { Ok(covariance) } else { Err(Refusal::PoorlyDetermined) }
    }

    fn sandwiches(&self) -> Matrix4<f64> {
        // A tilt δ of X in the silo frame: r_y falls by δ_x, r_x grows by δ_y / cos r_y, and the axis, held at the
        // walls' height h, moves by hδ where it passes the camera.
        let (h, cos) = (self.height, self.pose.r_y.cos());
        let tilt = Matrix4x2::new(0.0, 1.0 / cos, -1.0, 0.0, h, 0.0, 0.0, h);
        let shift = Matrix4x2::new(0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0);
        tilt * self.of_tilt() * tilt.transpose() + shift * self.of_point() * shift.transpose()
    }

    /// The tilt solves Σ e (e·δ + E1·X) = 0 over the walls, e being the part of E1 across the axis.
    fn of_tilt(&self) -> Matrix2<f64> {
        let square = |e: &Vec3| e.xy() * e.xy().transpose();
        let walls: Matrix2<f64> = self.e1.iter().map(square).sum();
        let scores = self.block.iter().zip(self.e1).map(|(block, e)| (*block, (e.xy() * e.z).into()));
        self.sandwich(&(walls - self.hold_lost()), sums(scores, self.blocks))
    }

    /// What leaving candidates out costs: those that enter and leave at the limit as X turns weaken its hold by the
    /// limit times their density there. Where they are as dense as anywhere else, any direction would hold itself.
    fn hold_lost(&self) -> Matrix2<f64> {
        let near = |e: &&Vec3| (e.z.abs() - self.limit).abs() < LIMIT_WINDOW * self.limit;
        let at_limit: Matrix2<f64> = self.candidates.iter().filter(near).map(|e| e.xy() * e.xy().transpose()).sum();
        at_limit / (2.0 * LIMIT_WINDOW)
    }

    /// Each coordinate solves Σ sign(x_i − median) = 0, whose slope is the density of the estimates at the median.
    fn of_point(&self) -> Matrix2<f64> {
        let some: Vec<&AxisPoint> = self.estimates.iter().step_by(STRIDE).collect();
        let columns = [0, 1].map(|k| some.iter().map(|e| e.at[k]).collect::<Vec<_>>());
        let centre = columns.clone().map(|column| quantiles(column, [0.35, 0.5, 0.65]));
        let n = some.len() as f64;
        let density = centre.map(|[low, _, high]| n * 0.3 / (high - low).max(f64::MIN_POSITIVE));
        let signs = |e: &AxisPoint| [0, 1].map(|k| 0.5 * (e.at[k] - centre[k][1]).signum());
        let block = |wall: u32| self.block[wall as usize];
        let planes = some.iter().map(|e| (block(e.plane), signs(e)));
        let lines = some.iter().map(|e| (block(e.line), signs(e)));
        let both = [sums(planes, self.blocks), sums(lines, self.blocks)];
        let bread = Matrix2::from_diagonal(&Vector2::from(density));
        both.into_iter().map(|scores| self.sandwich(&bread, scores)).sum()
    }

    fn sandwich(&self, bread: &Matrix2<f64>, scores: Vec<[f64; 2]>) -> Matrix2<f64> {
        let meat: Matrix2<f64> = scores.into_iter().map(Vector2::from).map(|s| s * s.transpose()).sum();
        let few = self.blocks as f64 / (self.blocks as f64 - 2.0).max(0.0);
        let holds = bread.m11 > 0.0 && bread.determinant() > 0.0;
        let inverse = bread.try_inverse().filter(|_| holds).unwrap_or_else(|| Matrix2::repeat(f64::INFINITY));
        inverse * meat * inverse * few
    }
}

fn quantiles<const N: usize>(mut values: Vec<f64>, at: [f64; N]) -> [f64; N] {
    let last = values.len().saturating_sub(1) as f64;
    at.map(|q| match values.is_empty() {
        true => f64::NAN,
        false => *values.select_nth_unstable_by((q * last).round() as usize, f64::total_cmp).1,
    })
}
