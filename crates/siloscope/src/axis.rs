//! Steps 4 and 5: direction of the axis (Eq. 3) and a point on it (Eq. 4).

use crate::workers::Workers;
use crate::{SiloPose, Vec3, eigen};
use nalgebra::{Matrix3, Vector2};

/// Axis direction X with the evidence for it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Direction {
    /// Unit direction, z > 0.
    pub x: Vec3,
    /// Eigenvectors of S/n, the first being X.
    pub vectors: [Vec3; 3],
    /// Their eigenvalues in rising order, with sum 1: how much of E1 lies along each.
    pub spread: [f64; 3],
}

/// Direction of greatest variability of the cross products E1 × E1' of all pairs (Eq. 3).
///
/// No pair is formed: Σ (E1 × E1')(E1 × E1')ᵀ over all pairs is proportional to the adjugate of S = Σ E1 E1ᵀ, so its
/// leading eigenvector is that of the smallest eigenvalue of S.
pub fn axis_direction(e1: impl ExactSizeIterator<Item = Vec3>) -> Direction {
    let n = e1.len().max(1) as f64;
    let s: Matrix3<f64> = e1.map(|e| e * e.transpose()).sum();
    let (spread, vectors) = eigen::symmetric(&(s / n));
    let x = if vectors[0].z < 0.0 { -vectors[0] } else { vectors[0] };
    Direction { x, vectors, spread }
}

/// A wall point with its normal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wall {
    /// The point p.
    pub p: Vec3,
    /// Its unit normal N.
    pub normal: Vec3,
}

/// One estimated axis point, and the two wall points behind it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AxisPoint {
    /// Where the axis meets the plane through the camera perpendicular to X, in the silo's x and y.
    pub at: Vector2<f64>,
    /// How far along X the normal met the plane.
    pub along: f64,
    /// Number of the wall point p whose plane was met.
    pub plane: usize,
    /// Number of the wall point p' whose normal met it.
    pub line: usize,
}

/// Estimated axis points (Eq. 4): planes π(p, X, N) met by the normal lines p' + λN'.
///
/// The paper leaves open which quartile of (N × X)·N' is the first and how its s members are picked. Here it is the
/// quarter nearest to ±1, where line and plane meet at the best angle, of 4s points spread evenly over the walls as
/// given. With walls given in order of |k2|, turning or mirroring the scene changes none of it.
pub fn axis_points(walls: &[Wall], x: &Vec3, partners: usize, workers: &Workers) -> Vec<AxisPoint> {
    let pool = spread_evenly(walls.len(), 4 * partners);
    let turn = SiloPose::from_axis(x, &Vec3::zeros()).rotation();
    let of_plane = |i: usize| -> Vec<AxisPoint> {
        let Wall { p, normal } = walls[i];
        let across = normal.cross(x);
        let mut lines: Vec<(f64, usize)> = pool.iter().map(|j| (-across.dot(&walls[*j].normal).abs(), *j)).collect();
        let quartile = lines.len().div_ceil(4);
        lines.select_nth_unstable_by(quartile - 1, |a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let meet = |(_, j): &(f64, usize)| {
            let other = walls[*j];
            let lambda = (p - other.p).dot(&across) / other.normal.dot(&across);
            let met = turn * (other.p + other.normal * lambda);
            AxisPoint { at: met.xy(), along: met.z, plane: i, line: *j }
        };
        lines[..quartile].iter().map(meet).filter(|found| found.at.iter().all(|c| c.is_finite())).collect()
    };
    if pool.is_empty() { Vec::new() } else { workers.map(walls.len(), of_plane).into_iter().flatten().collect() }
}

/// Up to `m` numbers below n, evenly spread.
fn spread_evenly(n: usize, m: usize) -> Vec<usize> {
    let m = m.min(n);
    (0..m).map(|i| i * n / m).collect()
}

/// The axis point a at the camera's height in the camera frame: medians of the estimated ones in x and y.
pub fn axis_point(estimates: &[AxisPoint], x: &Vec3) -> Option<Vec3> {
    let median_of = |i: usize| median(estimates.iter().map(|e| e.at[i]).collect());
    let turn = SiloPose::from_axis(x, &Vec3::zeros()).rotation();
    Some(turn.transpose() * Vec3::new(median_of(0)?, median_of(1)?, 0.0))
}

/// Median; of an even number of values the mean of the middle two.
pub fn median(mut values: Vec<f64>) -> Option<f64> {
    let (half, even) = (values.len() / 2, values.len().is_multiple_of(2));
    if values.is_empty() {
        return None;
    }
    let (below, &mut upper, _) = values.select_nth_unstable_by(half, f64::total_cmp);
    let lower = below.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    Some(if even { 0.5 * (lower + upper) } else { upper })
}
