//! Steps 4 and 5: direction of the axis (Eq. 3) and a point on it (Eq. 4).

use crate::base::workers::Workers;
use crate::shape_tensor::candidates::Candidate;
use crate::stats::eigen;
use crate::stats::robust::{MAD_TO_STD, median};
use crate::{SiloPose, Vec3};
use nalgebra::{Matrix3, Vector2};

/// Axis direction with the evidence for it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Direction {
    /// Unit direction X, z > 0.
    pub x: Vec3,
    /// Eigenvectors of S/n, the first along X.
    pub vectors: [Vec3; 3],
    /// Their eigenvalues in rising order, with sum 1: how much of E1 lies along each.
    pub spread: [f64; 3],
}

/// Direction of greatest variability of the cross products E1 × E1' of all pairs (Eq. 3).
///
/// No pair is formed: Σ (E1 × E1')(E1 × E1')ᵀ over all pairs is twice the adjugate of S = Σ E1 E1ᵀ, so its leading
/// eigenvector is that of the smallest eigenvalue of S.
pub fn axis_direction(e1: impl IntoIterator<Item = Vec3>) -> Direction {
    let s: Matrix3<f64> = e1.into_iter().map(|e| e * e.transpose()).sum();
    let (spread, vectors) = eigen::symmetric(&(s / s.trace().max(f64::MIN_POSITIVE)));
    let x = if vectors[0].z < 0.0 { -vectors[0] } else { vectors[0] };
    Direction { x, vectors, spread }
}

/// Share of the candidates, those with the smallest |k2|, that the first direction is drawn from.
const CLEAREST: f64 = 0.2;
/// Rounds of leaving out and drawing again; more change nothing.
const ROUNDS: usize = 5;

/// A direction with the candidates that agree with it.
#[derive(Debug, Clone, PartialEq)]
pub struct Consensus {
    /// The direction.
    pub direction: Direction,
    /// Largest |E1·X| of a candidate that agrees.
    pub limit: f64,
    /// The candidates that do.
    pub kept: Vec<Candidate>,
}

/// Direction of the axis from the candidates that agree with each other.
///
/// By Property 3 every wall point's E1 is perpendicular to X. Candidates farther from that than `agreement` robust
/// standard deviations are feed, edges, or spoilt by noise: a handful of them outweighs thousands of good ones.
/// The direction is drawn from the clearest candidates first and then from all, each time without those. An infinite
/// `agreement` leaves none out and draws once.
pub fn consistent_direction(candidates: &[Candidate], agreement: f64) -> Consensus {
    let (mut kept, mut limit) = (candidates.to_vec(), f64::INFINITY);
    if agreement.is_finite() {
        let clearest = (CLEAREST * candidates.len() as f64).ceil() as usize;
        kept.truncate(clearest);
        for round in 0..2 * ROUNDS {
            let x = direction_of(&kept).x;
            let off = |c: &Candidate| c.e1.dot(&x).abs();
            if round < ROUNDS {
                limit = agreement * MAD_TO_STD * median(kept.iter().map(off).collect()).unwrap_or(0.0) + f64::EPSILON;
            }
            let among = if round < ROUNDS - 1 { clearest } else { candidates.len() };
            kept = candidates[..among].iter().filter(|c| off(c) <= limit).copied().collect();
        }
    }
    Consensus { direction: direction_of(&kept), limit, kept }
}

fn direction_of(candidates: &[Candidate]) -> Direction {
    axis_direction(candidates.iter().map(|c| c.e1))
}

/// A wall point with its normal, in the camera frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wall {
    /// The point p.
    pub p: Vec3,
    /// Its unit normal N.
    pub normal: Vec3,
}

/// One estimated axis point, and the two wall points behind it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct AxisPoint {
    /// Where the axis meets the plane through the camera perpendicular to X, in the silo's x and y.
    pub at: Vector2<f64>,
    /// Number of the wall point p whose plane was met.
    pub plane: u32,
    /// Number of the wall point p' whose normal line met it.
    pub line: u32,
}

/// Estimated axis points (Eq. 4): planes π(p, X, N) met by the normal lines p' + λN', projected along X.
///
/// The paper leaves open which quartile of (N × X)·N' is the first and how its s members are picked. Here it is the
/// quarter nearest to ±1, where line and plane meet at the best angle, of 4s points spread evenly over the walls as
/// given. With walls in order of |k2|, neither turning nor mirroring the scene changes anything.
///
/// Seen along X, planes and lines are all lines in two dimensions, and that is where they are met.
/// Of more than `PLANES` walls only so many, evenly spread, lend their planes: neighbours' planes say the same.
pub fn axis_points(walls: &[Wall], x: &Vec3, partners: usize, workers: &Workers) -> Vec<AxisPoint> {
    let turn = SiloPose::from_axis(x, &Vec3::zeros()).rotation();
    let seen: Vec<[Vector2<f64>; 2]> = walls.iter().map(|w| [w.p, w.normal].map(|v| (turn * v).xy())).collect();
    let (planes, pool) = (spread_evenly(walls.len(), PLANES), spread_evenly(walls.len(), 4 * partners));
    let quartile = pool.len().div_ceil(4);
    let mut estimates = vec![AxisPoint::default(); planes.len() * quartile];
    workers.for_parts(&mut estimates, quartile, |i, found| {
        let [p, normal] = seen[planes[i] as usize];
        let across = Vector2::new(normal.y, -normal.x); // N × X
        let rank = |j: &u32| (-across.dot(&seen[*j as usize][1]).abs(), *j);
        let mut ranked: Vec<(f64, u32)> = pool.iter().map(rank).collect();
        ranked.select_nth_unstable_by(quartile - 1, |a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        for (estimate, (_, j)) in found.iter_mut().zip(ranked) {
            let [other, line] = seen[j as usize];
            let lambda = (p - other).dot(&across) / line.dot(&across);
            *estimate = AxisPoint { at: other + line * lambda, plane: planes[i], line: j };
        }
    });
    estimates.retain(|estimate| estimate.at.iter().all(|c| c.is_finite()));
    estimates
}

/// Most planes that are met.
const PLANES: usize = 1500;

/// Up to `m` numbers below n, evenly spread.
fn spread_evenly(n: usize, m: usize) -> Vec<u32> {
    let m = m.min(n);
    (0..m).map(|i| (i * n / m) as u32).collect()
}

/// The axis point a at the camera's height, in the silo's x and y: the medians of the estimated ones.
pub fn axis_point(estimates: &[AxisPoint], workers: &Workers) -> Option<Vector2<f64>> {
    let median_of = |i: usize| median(estimates.iter().map(|e| e.at[i]).collect());
    let (x, y) = workers.join(|| median_of(0), || median_of(1));
    Some(Vector2::new(x?, y?))
}
