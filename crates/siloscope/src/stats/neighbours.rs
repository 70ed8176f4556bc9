//! The k nearest neighbours of every point: a k-d tree whose leaves are asked together.

use crate::base::workers::Workers;
use crate::{Error, Result, Vec3};
use std::cmp::Ordering;
use std::ops::Range;

/// Points in a leaf of the tree.
const LEAF: usize = 16;
/// Bounds of the number of neighbours: fewer can't carry a cubic, more is no neighbourhood.
pub const NEIGHBOURS: std::ops::RangeInclusive<usize> = 6..=500;

/// Indices of the k nearest neighbours of every point, nearest first.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Neighbours {
    k: usize,
    index: Vec<u32>,
}

impl Neighbours {
    /// Number of neighbours of every point: what was asked for, or all others where the cloud is smaller.
    pub fn k(&self) -> usize {
        self.k
    }

    /// Neighbours of point `i`, nearest first.
    pub fn of(&self, i: usize) -> &[u32] {
        self.index.get(i * self.k..(i + 1) * self.k).unwrap_or_default()
    }

    /// All indices, point by point.
    pub fn indices(&self) -> &[u32] {
        &self.index
    }

    /// Neighbours found elsewhere: `k` indices for each of `n` points.
    pub fn from_indices(k: usize, index: Vec<u32>, n: usize) -> Result<Self> {
        if index.len() != k * n {
            return Err(Error::Shape { what: "neighbours", got: index.len(), expected: k * n });
        }
        match index.iter().find(|i| **i as usize >= n) {
            Some(i) => Err(Error::Setting { name: "neighbours", bounds: "indices of points", value: f64::from(*i) }),
            None => Ok(Self { k, index }),
        }
    }
}

/// The k nearest other points of every point, nearest first; equally near ones in order of their indices.
pub fn nearest_neighbours(points: &[Vec3], k: usize, workers: &Workers) -> Result<Neighbours> {
    if !NEIGHBOURS.contains(&k) {
        return Err(Error::Setting { name: "neighbours", bounds: "between 6 and 500", value: k as f64 });
    }
    let fits = u32::try_from(points.len()).is_ok() && points.iter().all(|p| p.iter().all(|c| c.abs() < 1e100));
    if !fits {
        return Err(Error::Setting { name: "points", bounds: "finite coordinates", value: f64::NAN });
    }
    let k = k.min(points.len().saturating_sub(1));
    if k == 0 {
        return Ok(Neighbours::default());
    }
    let tree = Tree::new(points, workers);
    let by_leaf = workers.map(tree.leaves(), |leaf| tree.neighbours_of_leaf(leaf, k));
    let mut index = vec![0; points.len() * k];
    for (leaf, neighbours) in by_leaf.iter().enumerate() {
        for (id, row) in tree.ids_of_leaf(leaf).iter().zip(neighbours.chunks_exact(k)) {
            let start = *id as usize * k;
            index.get_mut(start..start + k).into_iter().for_each(|out| out.copy_from_slice(row));
        }
    }
    Ok(Neighbours { k, index })
}

/// A balanced k-d tree: node j of level L holds the points from j·n/2^L to (j+1)·n/2^L of the reordered cloud.
struct Tree {
    ids: Vec<u32>,
    points: Vec<Vec3>,
    /// Bounding boxes of the nodes, level by level from the root.
    boxes: Vec<Bounds>,
    levels: u32,
}

/// A neighbour on trial: the bits of its squared distance, which are in the same order as the number, and its index.
type Found = u128;

fn trial(squared: f64, id: u32) -> Found {
    (Found::from(squared.to_bits()) << 32) | Found::from(id)
}

impl Tree {
    fn new(points: &[Vec3], workers: &Workers) -> Self {
        let n = points.len();
        let levels = (0..).find(|levels| n >> levels <= LEAF).unwrap_or(0);
        let mut ids: Vec<u32> = (0..n as u32).collect();
        split(&mut ids, points, Node { n, levels, level: 0, j: 0 }, workers);
        let points: Vec<Vec3> = ids.iter().map(|id| points[*id as usize]).collect();
        let mut tree = Self { ids, points, boxes: Vec::new(), levels };
        tree.boxes = tree.bounds();
        tree
    }

    fn bounds(&self) -> Vec<Bounds> {
        let inner = self.leaves() - 1;
        let mut boxes = vec![Bounds::of(&[]); inner];
        boxes.extend((0..self.leaves()).map(|leaf| Bounds::of(&self.points[self.range(self.levels, leaf)])));
        for node in (0..inner).rev() {
            boxes[node] = boxes[2 * node + 1].union(&boxes[2 * node + 2]);
        }
        boxes
    }

    fn leaves(&self) -> usize {
        1 << self.levels
    }

    fn range(&self, level: u32, node: usize) -> Range<usize> {
        part(self.ids.len(), level, node)..part(self.ids.len(), level, node + 1)
    }

    fn ids_of_leaf(&self, leaf: usize) -> &[u32] {
        &self.ids[self.range(self.levels, leaf)]
    }

    /// The k nearest neighbours of every point of a leaf, one after the other.
    ///
    /// A point's k-th neighbour is no farther than that of another point plus the step between the two, so only the
    /// first point of a leaf has to look for a bound.
    fn neighbours_of_leaf(&self, leaf: usize, k: usize) -> Vec<u32> {
        let range = self.range(self.levels, leaf);
        let mut result = Vec::with_capacity(range.len() * k);
        let (mut found, mut open) = (Vec::new(), Vec::new());
        let mut done: Vec<(Vec3, f64)> = Vec::with_capacity(range.len());
        for i in range {
            let p = self.points[i];
            let reach = done.iter().map(|(q, reach)| reach + (p - q).norm()).min_by(f64::total_cmp);
            let bound = reach.map_or_else(|| self.first_bound(leaf, k, &p), |reach| reach.powi(2) * (1.0 + 1e-12));
            self.within(i, bound, &mut open, &mut found);
            done.push((p, keep_nearest(&mut found, k)));
            result.extend(found.iter().map(|found| *found as u32));
        }
        result
    }

    /// Squared distance within which k others surely lie: the farthest of the smallest node around that holds them.
    fn first_bound(&self, leaf: usize, k: usize, p: &Vec3) -> f64 {
        let around = |up: u32| self.range(self.levels - up, leaf >> up);
        let up = (0..self.levels).find(|up| around(*up).len() > k).unwrap_or(self.levels);
        self.points[around(up)].iter().map(|q| (q - p).norm_squared()).fold(0.0, f64::max)
    }

    /// All points but point `i` itself within the squared distance `bound` of it.
    fn within(&self, i: usize, bound: f64, open: &mut Vec<(u32, usize)>, found: &mut Vec<Found>) {
        let p = self.points[i];
        found.clear();
        open.push((0, 0));
        while let Some((level, node)) = open.pop() {
            if self.boxes[(1 << level) - 1 + node].squared_distance(&p) > bound {
                continue;
            }
            if level < self.levels {
                open.extend([(level + 1, 2 * node + 1), (level + 1, 2 * node)]);
                continue;
            }
            for j in self.range(level, node) {
                let squared = (self.points[j] - p).norm_squared();
                if squared <= bound && j != i {
                    found.push(trial(squared, self.ids[j]));
                }
            }
        }
    }
}

/// Keeps the k nearest in order and returns the distance of the last.
fn keep_nearest(found: &mut Vec<Found>, k: usize) -> f64 {
    if found.len() > k {
        found.select_nth_unstable(k);
        found.truncate(k);
    }
    found.sort_unstable();
    found.last().map_or(0.0, |found| f64::from_bits((found >> 32) as u64).sqrt())
}

/// Where node `node` of a level begins among n points.
fn part(n: usize, level: u32, node: usize) -> usize {
    (n * node) >> level
}

/// Node j of a level, in a tree of `levels` levels over n points.
#[derive(Clone, Copy)]
struct Node {
    n: usize,
    levels: u32,
    level: u32,
    j: usize,
}

/// Splits a node's points halfway along the widest side of their box, down to the leaves.
fn split(ids: &mut [u32], points: &[Vec3], node: Node, workers: &Workers) {
    if node.level == node.levels {
        return;
    }
    let bounds = ids.iter().fold(Bounds::of(&[]), |b, id| b.with(&points[*id as usize]));
    let axis = (bounds.high - bounds.low).imax();
    let half = part(node.n, node.level + 1, 2 * node.j + 1) - part(node.n, node.level, node.j);
    let along = |id: &u32| (points[*id as usize][axis], *id);
    ids.select_nth_unstable_by(half, |a, b| along(a).partial_cmp(&along(b)).unwrap_or(Ordering::Equal));
    let (low, high) = ids.split_at_mut(half);
    let child = |right: usize| Node { level: node.level + 1, j: 2 * node.j + right, ..node };
    workers.join(|| split(low, points, child(0), workers), || split(high, points, child(1), workers));
}

#[derive(Clone, Copy)]
struct Bounds {
    low: Vec3,
    high: Vec3,
}

impl Bounds {
    fn of(points: &[Vec3]) -> Self {
        let nothing = Self { low: Vec3::repeat(f64::INFINITY), high: Vec3::repeat(f64::NEG_INFINITY) };
        points.iter().fold(nothing, |bounds, p| bounds.with(p))
    }

    fn with(self, p: &Vec3) -> Self {
        Self { low: self.low.inf(p), high: self.high.sup(p) }
    }

    fn union(&self, other: &Self) -> Self {
        Self { low: self.low.inf(&other.low), high: self.high.sup(&other.high) }
    }

    /// Squared distance from a point to the box.
    fn squared_distance(&self, p: &Vec3) -> f64 {
        let gap = |low: f64, high: f64, p: f64| (low - p).max(p - high).max(0.0);
        let (x, y, z) =
            (gap(self.low.x, self.high.x, p.x), gap(self.low.y, self.high.y, p.y), gap(self.low.z, self.high.z, p.z));
        x * x + y * y + z * z
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn slow(points: &[Vec3], k: usize) -> Vec<u32> {
        let of = |i: usize| {
            let distance = |j: u32| ((points[j as usize] - points[i]).norm_squared().to_bits(), j);
            let mut others: Vec<(u64, u32)> =
                (0..points.len() as u32).filter(|j| *j as usize != i).map(distance).collect();
            others.sort_unstable();
            others.into_iter().take(k).map(|(_, j)| j)
        };
        (0..points.len()).flat_map(of).collect()
    }

    proptest! {
        #[test]
        fn neighbours_are_those_of_brute_force(
            cells in prop::collection::vec([-9..9i32, -9..9, 0..3], 0..300), jitter in prop::bool::ANY, k in 6..40usize, threads in 1..3usize
        ) {
            // Whole numbers give duplicates and many equal distances.
            let point = |(i, c): (usize, &[i32; 3])| {
                let shift = if jitter { (i as f64 * 0.7).sin() * 0.4 } else { 0.0 };
                Vec3::new(f64::from(c[0]) + shift, f64::from(c[1]) - shift, f64::from(c[2]))
            };
            let points: Vec<Vec3> = cells.iter().enumerate().map(point).collect();
            let found = nearest_neighbours(&points, k, &Workers::new(threads)).unwrap();
            prop_assert_eq!(found.k(), k.min(points.len().saturating_sub(1)));
            prop_assert_eq!(found.indices(), slow(&points, k));
        }
    }

    #[test]
    fn a_line_of_duplicates_is_no_trap() -> Result<()> {
        let points = vec![Vec3::new(1.0, 2.0, 3.0); 5000];
        let found = nearest_neighbours(&points, 6, &Workers::new(1))?;
        assert_eq!(found.of(3), [0, 1, 2, 4, 5, 6]);
        Ok(())
    }

    #[test]
    fn bad_input_is_refused() {
        let points = vec![Vec3::zeros(); 10];
        assert!(nearest_neighbours(&points, 5, &Workers::new(1)).is_err());
        assert!(nearest_neighbours(&[Vec3::new(f64::NAN, 0.0, 0.0)], 6, &Workers::new(1)).is_err());
        assert!(Neighbours::from_indices(2, vec![0, 1, 2], 2).is_err());
        assert!(Neighbours::from_indices(1, vec![0, 2], 2).is_err());
    }
}
