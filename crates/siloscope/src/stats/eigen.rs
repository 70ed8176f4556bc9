//! Eigenvectors of symmetric 3×3 matrices.

use crate::Vec3;
use nalgebra::Matrix3;

/// Eigenvalues in rising order, with unit eigenvectors in the same order.
///
/// Jacobi's method: slower than a closed form, and right to the last bits however close the eigenvalues are.
pub fn symmetric(matrix: &Matrix3<f64>) -> ([f64; 3], [Vec3; 3]) {
    let (mut a, mut v) = (*matrix, Matrix3::identity());
    for _ in 0..12 {
        let off = a[(0, 1)].abs() + a[(0, 2)].abs() + a[(1, 2)].abs();
        if off <= 1e-17 * a.trace().abs() {
            break;
        }
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            let g = jacobi_rotation(&a, p, q);
            a = g.transpose() * a * g;
            v *= g;
        }
    }
    let mut order = [0, 1, 2];
    order.sort_by(|i, j| a[(*i, *i)].total_cmp(&a[(*j, *j)]));
    (order.map(|i| a[(i, i)]), order.map(|i| v.column(i).normalize()))
}

/// Rotation of the axes p and q that makes the entry (p, q) zero.
fn jacobi_rotation(a: &Matrix3<f64>, p: usize, q: usize) -> Matrix3<f64> {
    let mut g = Matrix3::identity();
    if a[(p, q)] != 0.0 {
        let theta = (a[(q, q)] - a[(p, p)]) / (2.0 * a[(p, q)]);
        let t = theta.signum() / (theta.abs() + theta.hypot(1.0));
        let c = 1.0 / t.hypot(1.0);
        (g[(p, p)], g[(q, q)], g[(p, q)], g[(q, p)]) = (c, c, t * c, -t * c);
    }
    g
}

/// Unit eigenvector of the smallest eigenvalue of a positive semidefinite matrix.
///
/// The eigenvalue comes from Newton's steps on the characteristic polynomial from below, where it is convex and the
/// steps can't overshoot; the vector is perpendicular to the rows of M − λI.
pub fn smallest(m: &Matrix3<f64>) -> Vec3 {
    let scale = m.trace();
    if !(scale > 0.0 && scale.is_finite()) {
        return Vec3::z();
    }
    let m = m / scale;
    let lambda = smallest_root(&m);
    let shifted = m - Matrix3::from_diagonal_element(lambda);
    let [r0, r1, r2] = [0, 1, 2].map(|i| shifted.column(i).into_owned());
    let crosses = [r0.cross(&r1), r0.cross(&r2), r1.cross(&r2)];
    let best = crosses.into_iter().max_by(|a, b| a.norm_squared().total_cmp(&b.norm_squared())).unwrap_or_default();
    // Two small eigenvalues close together leave no cross product to trust.
    if best.norm_squared() < 1e-12 { symmetric(&m).1[0] } else { best.normalize() }
}

/// Smallest root of det(M − λI) for a positive semidefinite matrix of trace 1.
fn smallest_root(m: &Matrix3<f64>) -> f64 {
    let minors = m[(0, 0)] * m[(1, 1)] - m[(0, 1)].powi(2) + m[(0, 0)] * m[(2, 2)] - m[(0, 2)].powi(2)
        + m[(1, 1)] * m[(2, 2)]
        - m[(1, 2)].powi(2);
    let det = m.determinant();
    let mut lambda = 0.0;
    for _ in 0..20 {
        let value = det - lambda * (minors - lambda * (1.0 - lambda));
        let slope = minors - lambda * (2.0 - 3.0 * lambda);
        let step = value / slope;
        if !(slope > 0.0 && step > 1e-16) {
            break;
        }
        lambda += step;
    }
    lambda
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn scatter(points: &[[f64; 3]]) -> Matrix3<f64> {
        points.iter().map(|p| Vec3::from(*p)).map(|p| p * p.transpose()).sum()
    }

    proptest! {
        #[test]
        fn eigenvectors_solve_the_equation(points in prop::collection::vec([-1.0..1.0f64, -1.0..1.0, -1.0..1.0], 1..9)) {
            let m = scatter(&points);
            let (values, vectors) = symmetric(&m);
            for (value, vector) in values.iter().zip(&vectors) {
                prop_assert!((m * vector - vector * *value).norm() < 1e-12);
                prop_assert!((vector.norm() - 1.0).abs() < 1e-12);
            }
            prop_assert!(values[0] <= values[1] && values[1] <= values[2]);
        }

        #[test]
        fn the_smallest_one_is_the_first(points in prop::collection::vec([-1.0..1.0f64, -1.0..1.0, -0.1..0.1], 3..9)) {
            let m = scatter(&points);
            let (values, _) = symmetric(&m);
            let v = smallest(&m);
            prop_assert!((v.norm() - 1.0).abs() < 1e-12);
            prop_assert!((v.dot(&(m * v)) - values[0]).abs() < 1e-12, "Rayleigh quotient");
        }
    }

    #[test]
    fn degenerate_matrices_give_unit_vectors() {
        let line = Vec3::new(1.0, 2.0, 2.0);
        for m in [Matrix3::zeros(), Matrix3::identity(), line * line.transpose(), Matrix3::repeat(f64::NAN)] {
            assert!((smallest(&m).norm() - 1.0).abs() < 1e-12);
        }
        assert!(smallest(&(line * line.transpose())).dot(&line).abs() < 1e-12);
    }
}
