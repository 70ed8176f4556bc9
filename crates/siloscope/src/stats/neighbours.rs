//! The k nearest neighbours of every point: the leaves of a k-d tree, whose points are asked together.

use crate::base::workers::Workers;
use crate::stats::kd_tree::KdTree;
use crate::{Error, Result, Vec3};

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
    let tree = KdTree::new(points.iter().copied(), workers);
    let by_leaf = workers.map(tree.leaves(), |leaf| neighbours_of_leaf(&tree, leaf, k));
    let mut index = vec![0; points.len() * k];
    for (leaf, neighbours) in by_leaf.iter().enumerate() {
        for (id, row) in tree.ids()[tree.range_of_leaf(leaf)].iter().zip(neighbours.chunks_exact(k)) {
            let start = *id as usize * k;
            index.get_mut(start..start + k).into_iter().for_each(|out| out.copy_from_slice(row));
        }
    }
    Ok(Neighbours { k, index })
}

/// A neighbour on trial: the bits of its squared distance, which are in the same order as the number, and its index.
type Found = u128;

fn trial(squared: f64, id: u32) -> Found {
    (Found::from(squared.to_bits()) << 32) | Found::from(id)
}

/// The k nearest neighbours of every point of a leaf, one after the other.
///
/// A point's k-th neighbour is no farther than that of another point plus the step between the two, so only the
/// first point of a leaf has to look for a bound.
fn neighbours_of_leaf(tree: &KdTree, leaf: usize, k: usize) -> Vec<u32> {
    let range = tree.range_of_leaf(leaf);
    let mut result = Vec::with_capacity(range.len() * k);
    let (mut found, mut open) = (Vec::new(), Vec::new());
    let mut done: Vec<(Vec3, f64)> = Vec::with_capacity(range.len());
    for i in range {
        let p = tree.points()[i];
        let reach = done.iter().map(|(q, reach)| reach + (p - q).norm()).min_by(f64::total_cmp);
        let bound = reach.map_or_else(|| first_bound(tree, leaf, k, &p), |reach| reach.powi(2) * (1.0 + 1e-12));
        found.clear();
        tree.visit_within(&p, bound, &mut open, |j, squared| {
            if j != i {
                found.push(trial(squared, tree.ids()[j]));
            }
        });
        done.push((p, keep_nearest(&mut found, k)));
        result.extend(found.iter().map(|found| *found as u32));
    }
    result
}

/// Squared distance within which k others surely lie: the farthest of the smallest node around that holds them.
fn first_bound(tree: &KdTree, leaf: usize, k: usize, p: &Vec3) -> f64 {
    let around = tree.smallest_node_around(leaf, k);
    tree.points()[around].iter().map(|q| (q - p).norm_squared()).fold(0.0, f64::max)
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
