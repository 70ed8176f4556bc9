//! Distance from every point of one cloud to the nearest point of another (Eq. 11).

use crate::base::workers::{Workers, check_threads};
use crate::stats::kd_tree::KdTree;
use crate::{Error, Result, Vec3};

type Point = [f64; 3];

/// Distance from each query to its nearest reference point, metres.
///
/// Both clouds must be finite, and the reference must not be empty. The result does not depend on `threads`.
pub fn nearest_distances(queries: &[Point], reference: &[Point], threads: usize) -> Result<Vec<f64>> {
    check_threads(threads)?;
    if reference.is_empty() {
        return Err(Error::Shape { what: "reference cloud", got: 0, expected: 1 });
    }
    if let Some(&value) = queries.iter().chain(reference).flatten().find(|x| !x.is_finite()) {
        return Err(Error::Setting { name: "coordinates", bounds: "finite", value });
    }
    let workers = Workers::new(threads);
    let tree = KdTree::new(reference.iter().map(|p| Vec3::from(*p)), &workers);
    let mut distances = vec![0.0; queries.len()];
    let part = queries.len().div_ceil(threads).max(1);
    workers.for_parts(&mut distances, part, |i, distances| measure(&tree, &queries[i * part..], distances));
    Ok(distances)
}

/// Neighbouring queries have neighbouring answers, so each search starts with the last answer as its bound.
fn measure(tree: &KdTree, queries: &[Point], distances: &mut [f64]) {
    let mut nearest = 0;
    for (query, distance) in queries.iter().zip(distances) {
        let found = tree.nearest(&Vec3::from(*query), nearest);
        (*distance, nearest) = (found.0.sqrt(), found.1);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn square(a: &Point, b: &Point) -> f64 {
        (0..3).map(|i| (a[i] - b[i]) * (a[i] - b[i])).sum()
    }

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
