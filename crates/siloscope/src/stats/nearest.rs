//! Distance from every point of one cloud to the nearest point of another (Eq. 11).

use crate::{Error, Result};

/// Slices of at most this many points are scanned; a descent would cost more.
const LEAF: usize = 12;

type Point = [f64; 3];

/// Distance from each query to its nearest reference point, metres.
///
/// Both clouds must be finite, and the reference must not be empty. The result does not depend on `threads`.
pub fn nearest_distances(queries: &[Point], reference: &[Point], threads: usize) -> Result<Vec<f64>> {
    if !(1..=1024).contains(&threads) {
        return Err(Error::Setting { name: "threads", bounds: "between 1 and 1024", value: threads as f64 });
    }
    if reference.is_empty() {
        return Err(Error::Shape { what: "reference cloud", got: 0, expected: 1 });
    }
    if let Some(&value) = queries.iter().chain(reference).flatten().find(|x| !x.is_finite()) {
        return Err(Error::Setting { name: "coordinates", bounds: "finite", value });
    }
    let tree = Tree::new(reference);
    let mut distances = vec![0.0; queries.len()];
    let part = queries.len().div_ceil(threads).max(1);
    std::thread::scope(|scope| {
        for (queries, distances) in queries.chunks(part).zip(distances.chunks_mut(part)) {
            let tree = &tree;
            let mut job = move || tree.measure(queries, distances);
            if threads == 1 { job() } else { drop(scope.spawn(job)) }
        }
    });
    Ok(distances)
}

/// A balanced k-d tree without nodes: every slice of points is split at its middle point, along its widest side.
struct Tree {
    points: Vec<Point>,
    /// The side along which the slice with this middle was split.
    axes: Vec<u8>,
    /// Least and greatest coordinates.
    corners: [Point; 2],
}

impl Tree {
    fn new(reference: &[Point]) -> Self {
        let mut tree = Self { points: reference.to_vec(), axes: vec![0; reference.len()], corners: corners(reference) };
        split(&mut tree.points, &mut tree.axes);
        tree
    }

    /// Neighbouring queries have neighbouring answers, so each search starts with the last answer as its bound.
    fn measure(&self, queries: &[Point], distances: &mut [f64]) {
        let mut nearest = 0;
        for (query, distance) in queries.iter().zip(distances) {
            let mut best = (square(query, &self.points[nearest]), nearest);
            self.search(0, self.points.len(), query, self.outside(query), &mut best);
            nearest = best.1;
            *distance = best.0.sqrt();
        }
    }

    /// How far a point is outside the cloud's box along each axis.
    fn outside(&self, p: &Point) -> Point {
        std::array::from_fn(|axis| p[axis] - p[axis].clamp(self.corners[0][axis], self.corners[1][axis]))
    }

    /// Visits the slice `low..high`; `gaps` is how far the query is outside its box along each axis.
    fn search(&self, low: usize, high: usize, query: &Point, gaps: Point, best: &mut (f64, usize)) {
        if high - low <= LEAF {
            (low..high).for_each(|i| self.try_point(i, query, best));
            return;
        }
        let middle = low.midpoint(high);
        let axis = self.axes[middle] as usize;
        let offset = query[axis] - self.points[middle][axis];
        let halves = [(low, middle), (middle + 1, high)];
        let (near, far) = if offset < 0.0 { (halves[0], halves[1]) } else { (halves[1], halves[0]) };
        self.search(near.0, near.1, query, gaps, best);
        let mut beyond = gaps;
        beyond[axis] = offset;
        if square(&beyond, &[0.0; 3]) < best.0 {
            self.try_point(middle, query, best);
            self.search(far.0, far.1, query, beyond, best);
        }
    }

    fn try_point(&self, i: usize, query: &Point, best: &mut (f64, usize)) {
        let squared = square(query, &self.points[i]);
        if squared < best.0 {
            *best = (squared, i);
        }
    }
}

fn split(points: &mut [Point], axes: &mut [u8]) {
    if points.len() <= LEAF {
        return;
    }
    let axis = widest(points);
    let middle = points.len() / 2;
    points.select_nth_unstable_by(middle, |a, b| a[axis].total_cmp(&b[axis]));
    axes[middle] = axis as u8;
    let (low, high) = points.split_at_mut(middle);
    let (low_axes, high_axes) = axes.split_at_mut(middle);
    split(low, low_axes);
    split(&mut high[1..], &mut high_axes[1..]);
}

fn widest(points: &[Point]) -> usize {
    let [least, greatest] = corners(points);
    let width = |axis: usize| greatest[axis] - least[axis];
    (1..3).fold(0, |best, axis| if width(axis) > width(best) { axis } else { best })
}

fn corners(points: &[Point]) -> [Point; 2] {
    points.iter().fold([[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]], |[least, greatest], p| {
        [std::array::from_fn(|i| least[i].min(p[i])), std::array::from_fn(|i| greatest[i].max(p[i]))]
    })
}

fn square(a: &Point, b: &Point) -> f64 {
    (0..3).map(|i| (a[i] - b[i]) * (a[i] - b[i])).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn clouds() -> impl Strategy<Value = (Vec<Point>, Vec<Point>)> {
        let coordinate = prop_oneof![-1.0..1.0f64, Just(0.0), -1e3..1e3f64];
        let cloud = |low, high| proptest::collection::vec(proptest::array::uniform3(coordinate.clone()), low..high);
        (cloud(0, 60), cloud(1, 200))
    }

    proptest! {
        #[test]
        fn agrees_with_brute_force((queries, reference) in clouds(), threads in 1..5usize) {
            let found = nearest_distances(&queries, &reference, threads).unwrap_or_default();
            prop_assert_eq!(found.len(), queries.len());
            for (query, distance) in queries.iter().zip(found) {
                let nearest = reference.iter().map(|p| square(query, p)).fold(f64::INFINITY, f64::min).sqrt();
                prop_assert_eq!(distance, nearest);
            }
        }
    }

    #[test]
    fn a_cloud_of_equal_points_does_not_hang() {
        let same = vec![[1.0, 2.0, 3.0]; 50_000];
        let found = nearest_distances(&[[1.0, 2.0, 4.0]], &same, 1);
        assert_eq!(found, Ok(vec![1.0]));
    }

    #[test]
    fn unusable_clouds_are_refused() {
        let point = [[0.0; 3]];
        assert!(matches!(nearest_distances(&point, &[], 1), Err(Error::Shape { .. })));
        assert!(matches!(nearest_distances(&[[f64::NAN, 0.0, 0.0]], &point, 1), Err(Error::Setting { .. })));
        assert!(matches!(nearest_distances(&point, &point, 0), Err(Error::Setting { name: "threads", .. })));
        assert_eq!(nearest_distances(&[], &point, 3), Ok(vec![]));
    }
}
