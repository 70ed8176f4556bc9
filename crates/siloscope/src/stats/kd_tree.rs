//! A balanced k-d tree over points in space.

use crate::Vec3;
use crate::base::workers::Workers;
use std::ops::Range;

/// Most points in a leaf.
const LEAF: usize = 16;

/// A balanced k-d tree: node j of level L holds the points from j·n/2^L to (j+1)·n/2^L of the reordered cloud.
#[derive(Debug)]
pub struct KdTree {
    ids: Vec<u32>,
    points: Vec<Vec3>,
    /// Bounding boxes of the nodes, level by level from the root.
    boxes: Vec<Bounds>,
    levels: u32,
}

impl KdTree {
    /// The tree of fewer than 2³² finite points.
    pub fn new(points: impl ExactSizeIterator<Item = Vec3>, workers: &Workers) -> Self {
        let n = points.len();
        let levels = (0..).find(|levels| n >> levels <= LEAF).unwrap_or(0);
        let mut entries: Vec<Entry> = points.zip(0..).collect();
        split(&mut entries, Node { n, levels, level: 0, j: 0 }, workers);
        let (points, ids) = entries.into_iter().unzip();
        let mut tree = Self { ids, points, boxes: Vec::new(), levels };
        tree.boxes = tree.bounds();
        tree
    }

    fn bounds(&self) -> Vec<Bounds> {
        let inner = self.leaves() - 1;
        let mut boxes = vec![Bounds::of(&[]); inner];
        boxes.extend((0..self.leaves()).map(|leaf| Bounds::of(&self.points[self.range_of_leaf(leaf)])));
        for node in (0..inner).rev() {
            boxes[node] = boxes[2 * node + 1].union(&boxes[2 * node + 2]);
        }
        boxes
    }

    /// Number of leaves.
    pub fn leaves(&self) -> usize {
        1 << self.levels
    }

    /// Index in the cloud of every point of the tree.
    pub fn ids(&self) -> &[u32] {
        &self.ids
    }

    /// The points in the tree's order.
    pub fn points(&self) -> &[Vec3] {
        &self.points
    }

    /// Places of a leaf's points in the tree's order.
    pub fn range_of_leaf(&self, leaf: usize) -> Range<usize> {
        self.range(self.levels, leaf)
    }

    fn range(&self, level: u32, node: usize) -> Range<usize> {
        part(self.ids.len(), level, node)..part(self.ids.len(), level, node + 1)
    }

    /// Places of the points of the smallest node around a leaf that holds more than k of them, or of all points.
    pub fn smallest_node_around(&self, leaf: usize, k: usize) -> Range<usize> {
        let around = |up: u32| self.range(self.levels - up, leaf >> up);
        let up = (0..self.levels).find(|up| around(*up).len() > k).unwrap_or(self.levels);
        around(up)
    }

    /// Calls `see` with place and squared distance of every point within the squared distance `bound` of p.
    ///
    /// `open` is the search's stack, empty before and after; a caller with many queries keeps it.
    pub fn visit_within(&self, p: &Vec3, bound: f64, open: &mut Vec<(u32, usize)>, mut see: impl FnMut(usize, f64)) {
        open.push((0, 0));
        while let Some((level, node)) = open.pop() {
            if self.bounds_of(level, node).squared_distance(p) > bound {
                continue;
            }
            if level < self.levels {
                open.extend([(level + 1, 2 * node + 1), (level + 1, 2 * node)]);
                continue;
            }
            for j in self.range(level, node) {
                let squared = (self.points[j] - p).norm_squared();
                if squared <= bound {
                    see(j, squared);
                }
            }
        }
    }

    /// Squared distance and place of the point nearest to p; `guess` is the place of a point that may be near.
    pub fn nearest(&self, p: &Vec3, guess: usize) -> (f64, usize) {
        let mut best = ((self.points[guess] - p).norm_squared(), guess);
        self.search(0, 0, p, &mut best);
        best
    }

    /// Visits the nearer child first, and a child only where it can hold a nearer point.
    fn search(&self, level: u32, node: usize, p: &Vec3, best: &mut (f64, usize)) {
        if level == self.levels {
            for j in self.range(level, node) {
                let squared = (self.points[j] - p).norm_squared();
                if squared < best.0 {
                    *best = (squared, j);
                }
            }
            return;
        }
        let gap = |child: usize| (self.bounds_of(level + 1, child).squared_distance(p), child);
        let mut children = [gap(2 * node), gap(2 * node + 1)];
        if children[1].0 < children[0].0 {
            children.swap(0, 1);
        }
        for (gap, child) in children {
            if gap < best.0 {
                self.search(level + 1, child, p, best);
            }
        }
    }

    fn bounds_of(&self, level: u32, node: usize) -> &Bounds {
        &self.boxes[(1 << level) - 1 + node]
    }
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

/// A point with its index in the cloud.
type Entry = (Vec3, u32);

/// Splits a node's points halfway along the widest side of their box, down to the leaves.
fn split(entries: &mut [Entry], node: Node, workers: &Workers) {
    if node.level == node.levels {
        return;
    }
    let bounds = entries.iter().fold(Bounds::of(&[]), |bounds, (p, _)| bounds.with(p));
    let axis = (bounds.high - bounds.low).imax();
    let half = part(node.n, node.level + 1, 2 * node.j + 1) - part(node.n, node.level, node.j);
    entries.select_nth_unstable_by(half, |(p, _), (q, _)| p[axis].total_cmp(&q[axis]));
    let (low, high) = entries.split_at_mut(half);
    let child = |right: usize| Node { level: node.level + 1, j: 2 * node.j + right, ..node };
    workers.join(|| split(low, child(0), workers), || split(high, child(1), workers));
}

#[derive(Debug, Clone, Copy)]
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
