//! Step 3: points that potentially lie on the cylinder or the cone.

use crate::Vec3;
use crate::base::workers::Workers;
use crate::geometry::view::View;
use crate::shape_tensor::tensors::ShapeTensor;
use crate::stats::neighbours::Neighbours;

/// A point that may lie on a wall.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Candidate {
    /// Which point of the cloud.
    pub index: usize,
    /// The principal curvature across the generatrix: k1 seen from inside, k2 from outside.
    pub bent: f64,
    /// The one along it, 0 on cylinder and cone (Property 1).
    pub straight: f64,
    /// The principal direction of `bent`, perpendicular to the axis (Property 3).
    pub e1: Vec3,
}

impl Candidate {
    /// Of the two principal curvatures the one greater in size is taken as the bent one.
    fn new(index: usize, t: &ShapeTensor) -> Self {
        match t.k1.abs() >= t.k2.abs() {
            true => Self { index, bent: t.k1, straight: t.k2, e1: t.e1 },
            false => Self { index, bent: t.k2, straight: t.k1, e1: t.e2 },
        }
    }
}

/// The `share` with the smallest |k2|, in that order, of the points with a clear k1.
///
/// Clear is a radius of curvature below the extent of the cloud: a silo's radius is, and the direction in which flatter
/// ground bends is noise. A share of these and not of all points keeps a frame that is mostly feed from filling up
/// with it. Points at the edge of what is seen are left out: with neighbours on one side only they have no tensor,
/// like the points of R0 (section 2.2.3).
pub fn select_candidates(
    points: &[Vec3],
    neighbours: &Neighbours,
    tensors: &[ShapeTensor],
    share: f64,
    view: View,
    workers: &Workers,
) -> Vec<Candidate> {
    let least = 1.0 / extent(points);
    let clear = |c: &Candidate| {
        c.bent.abs() > least && view.allows(c.bent) && is_surrounded(points, c.index, neighbours.of(c.index))
    };
    let clear_one = |i: usize| tensors.get(i).map(|t| Candidate::new(i, t)).filter(clear);
    let mut candidates: Vec<_> = workers.map(tensors.len(), clear_one).into_iter().flatten().collect();
    candidates.sort_by(|a, b| a.straight.abs().total_cmp(&b.straight.abs()));
    candidates.truncate((share * candidates.len() as f64).ceil() as usize);
    candidates
}

/// How far the middle of a point's neighbours may lie from it, in units of the distance to the farthest of them.
const OFF_CENTRE: f64 = 0.15;

fn is_surrounded(points: &[Vec3], i: usize, neighbours: &[u32]) -> bool {
    let offsets = || neighbours.iter().map(|j| points[*j as usize] - points[i]);
    let farthest = offsets().map(|d| d.norm_squared()).fold(0.0, f64::max).sqrt();
    offsets().sum::<Vec3>().norm() <= OFF_CENTRE * farthest * neighbours.len() as f64
}

/// Diagonal of the cloud's bounding box.
fn extent(points: &[Vec3]) -> f64 {
    let low = points.iter().fold(Vec3::repeat(f64::INFINITY), |low, p| low.inf(p));
    let high = points.iter().fold(Vec3::repeat(f64::NEG_INFINITY), |high, p| high.sup(p));
    (high - low).norm()
}
