//! Step 2, second half: shape tensors by the adjacent-normal cubic approximation (Goldfeather and Interrante 2004).

use crate::Vec3;
use crate::base::workers::Workers;
use crate::stats::neighbours::Neighbours;
use nalgebra::{SMatrix, SVector};

/// Principal curvatures k1 ≥ k2 (1/m) and principal directions E1, E2 of one point (section 2.2.1).
///
/// Positive curvature bends towards the normal: seen from inside, a cylinder has k1 = 1/R and k2 = 0.
/// Where the neighbours don't determine the tensor all numbers are NaN.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShapeTensor {
    /// Greater principal curvature.
    pub k1: f64,
    /// Smaller principal curvature.
    pub k2: f64,
    /// Unit direction of k1.
    pub e1: Vec3,
    /// Unit direction of k2.
    pub e2: Vec3,
}

/// A neighbour whose normal is nearly perpendicular to the point's own is on another piece of surface: it is left out.
const STEEPEST: f64 = 0.1;

/// Weight of a position equation: its neighbour's normal is a mean over many points and so the better measurement.
const POSITION_WEIGHT: f64 = 0.5;
/// What it makes of products of such equations.
const W2: f64 = POSITION_WEIGHT * POSITION_WEIGHT;

/// Shape tensor of every point.
///
/// In local coordinates with the normal as z the surface is z = a/2 x² + b xy + c/2 y² + d x³ + e x²y + f xy² + g y³.
/// Each neighbour gives one equation for its position and two for its normal; the seven unknowns follow by least
/// squares and the tensor is ((a, b), (b, c)). Lengths are in units of the distance to the farthest neighbour, so
/// that the equations weigh alike at every scale.
pub fn shape_tensors(
    points: &[Vec3],
    neighbours: &Neighbours,
    normals: &[Vec3],
    workers: &Workers,
) -> Vec<ShapeTensor> {
    workers.map(points.len(), |i| shape_tensor(points, neighbours.of(i), normals, i))
}

fn shape_tensor(points: &[Vec3], neighbours: &[u32], normals: &[Vec3], i: usize) -> ShapeTensor {
    let (p, normal) = (points[i], normals[i]);
    let farthest = neighbours.iter().map(|j| (points[*j as usize] - p).norm_squared()).fold(0.0, f64::max);
    let scale = 1.0 / farthest.sqrt();
    let (t1, t2) = tangent_basis(&normal);
    let mut equations = Equations::default();
    for j in neighbours {
        let (d, m) = ((points[*j as usize] - p) * scale, normals[*j as usize]);
        let mz = m.dot(&normal);
        if mz.abs() > STEEPEST {
            let slope = [-m.dot(&t1) / mz, -m.dot(&t2) / mz];
            equations.add(d.dot(&t1), d.dot(&t2), d.dot(&normal), slope);
        }
    }
    match equations.solve() {
        Some([a, b, c]) => principal(a * scale, b * scale, c * scale, &t1, &t2),
        None => ShapeTensor { k1: f64::NAN, k2: f64::NAN, e1: Vec3::repeat(f64::NAN), e2: Vec3::repeat(f64::NAN) },
    }
}

/// An orthonormal basis of the tangent plane; any will do.
fn tangent_basis(normal: &Vec3) -> (Vec3, Vec3) {
    let t1 = normal.cross(&Vec3::ith(normal.iamin(), 1.0)).normalize();
    (t1, normal.cross(&t1))
}

/// Eigenvalues and eigenvectors of ((a, b), (b, c)), in space by E = e_1 T1 + e_2 T2.
fn principal(a: f64, b: f64, c: f64, t1: &Vec3, t2: &Vec3) -> ShapeTensor {
    let (mean, half_difference) = (0.5 * (a + c), 0.5 * (a - c));
    let radius = half_difference.hypot(b);
    let (sin, cos) = (0.5 * b.atan2(half_difference)).sin_cos();
    ShapeTensor { k1: mean + radius, k2: mean - radius, e1: t1 * cos + t2 * sin, e2: t2 * cos - t1 * sin }
}

/// The normal equations AᵀA u = Aᵀr of one point, u = (a, …, g).
///
/// Every entry of AᵀA is made of the moments Σ xⁱyʲ of degrees 2 to 6, so only those are added up.
#[derive(Default)]
struct Equations {
    /// Moments Σ x^(n−j) y^j of degree n = 2 … 6.
    m2: [f64; 3],
    m3: [f64; 4],
    m4: [f64; 5],
    m5: [f64; 6],
    m6: [f64; 7],
    right: [f64; 7],
}

impl Equations {
    /// One neighbour at (x, y, z) whose normal gives the slopes ∂z/∂x = p and ∂z/∂y = q.
    fn add(&mut self, x: f64, y: f64, z: f64, [p, q]: [f64; 2]) {
        let (xx, xy, yy) = (x * x, x * y, y * y);
        let cubic = [xx * x, xx * y, x * yy, yy * y];
        let wz = W2 * z;
        let rows = [
            0.5 * xx * wz + x * p,
            xy * wz + y * p + x * q,
            0.5 * yy * wz + y * q,
            cubic[0] * wz + 3.0 * xx * p,
            cubic[1] * wz + 2.0 * xy * p + xx * q,
            cubic[2] * wz + yy * p + 2.0 * xy * q,
            cubic[3] * wz + 3.0 * yy * q,
        ];
        let [c0, c1, c2, c3] = cubic;
        add(&mut self.right, rows);
        add(&mut self.m2, [xx, xy, yy]);
        add(&mut self.m3, cubic);
        add(&mut self.m4, [xx * xx, xx * xy, xx * yy, xy * yy, yy * yy]);
        add(&mut self.m5, [c0 * xx, c0 * xy, c0 * yy, xx * c3, xy * c3, yy * c3]);
        add(&mut self.m6, [c0 * c0, c0 * c1, c0 * c2, c0 * c3, c1 * c3, c2 * c3, c3 * c3]);
    }

    /// Position rows (x²/2, xy, y²/2, x³, x²y, xy², y³) and normal rows (x, y, 0, 3x², 2xy, y², 0) and
    /// (0, x, y, 0, x², 2xy, 3y²), multiplied out: the lower triangle.
    fn matrix(&self) -> SMatrix<f64, 7, 7> {
        let (m2, m3, m4, m5, m6) = (&self.m2, &self.m3, &self.m4, &self.m5, &self.m6);
        let mut a = SMatrix::<f64, 7, 7>::zeros();
        let quadratic = [0.5, 1.0, 0.5];
        for (i, fi) in quadratic.iter().enumerate() {
            (0..=i).for_each(|j| a[(i, j)] = W2 * fi * quadratic[j] * m4[i + j]);
            (0..4).for_each(|j| a[(3 + j, i)] = W2 * fi * m5[i + j]);
        }
        (0..4).for_each(|i| (0..=i).for_each(|j| a[(3 + i, 3 + j)] = W2 * m6[i + j]));
        let normal: [&[f64]; 7] = [
            &[m2[0]],
            &[m2[1], m2[0] + m2[2]],
            &[0.0, m2[1], m2[2]],
            &[3.0 * m3[0], 3.0 * m3[1], 0.0, 9.0 * m4[0]],
            &[2.0 * m3[1], m3[0] + 2.0 * m3[2], m3[1], 6.0 * m4[1], m4[0] + 4.0 * m4[2]],
            &[m3[2], 2.0 * m3[1] + m3[3], 2.0 * m3[2], 3.0 * m4[2], 2.0 * (m4[1] + m4[3]), 4.0 * m4[2] + m4[4]],
            &[0.0, 3.0 * m3[2], 3.0 * m3[3], 0.0, 3.0 * m4[2], 6.0 * m4[3], 9.0 * m4[4]],
        ];
        for (i, row) in normal.iter().enumerate() {
            row.iter().enumerate().for_each(|(j, entry)| a[(i, j)] += entry);
        }
        a
    }

    /// The quadratic terms a, b, c; None where the neighbours don't determine them.
    fn solve(&self) -> Option<[f64; 3]> {
        let cholesky = nalgebra::Cholesky::new(self.matrix())?;
        let diagonal = cholesky.l_dirty().diagonal();
        let u = cholesky.solve(&SVector::<f64, 7>::from(self.right));
        (diagonal.min() > 1e-6 * diagonal.max() && u.iter().all(|u| u.is_finite())).then_some([u[0], u[1], u[2]])
    }
}

fn add<const N: usize>(sums: &mut [f64; N], terms: [f64; N]) {
    sums.iter_mut().zip(terms).for_each(|(sum, term)| *sum += term);
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Rows as the method states them.
    fn rows(x: f64, y: f64) -> [SVector<f64, 7>; 3] {
        [
            [x * x / 2.0, x * y, y * y / 2.0, x.powi(3), x * x * y, x * y * y, y.powi(3)].into(),
            [x, y, 0.0, 3.0 * x * x, 2.0 * x * y, y * y, 0.0].into(),
            [0.0, x, y, 0.0, x * x, 2.0 * x * y, 3.0 * y * y].into(),
        ]
    }

    proptest! {
        #[test]
        fn moments_make_the_normal_equations(near in prop::collection::vec([-1.0..1.0f64, -1.0..1.0, -1.0..1.0, -1.0..1.0, -1.0..1.0], 1..9)) {
            let mut equations = Equations::default();
            let (mut ata, mut atr) = (SMatrix::<f64, 7, 7>::zeros(), SVector::<f64, 7>::zeros());
            for [x, y, z, p, q] in near {
                equations.add(x, y, z, [p, q]);
                for ((row, r), w) in rows(x, y).iter().zip([z, p, q]).zip([POSITION_WEIGHT, 1.0, 1.0]) {
                    ata += row * row.transpose() * w.powi(2);
                    atr += row * r * w.powi(2);
                }
            }
            prop_assert!((equations.matrix() - ata.lower_triangle()).norm() < 1e-12);
            prop_assert!((SVector::from(equations.right) - atr).norm() < 1e-12);
        }

        #[test]
        fn a_cubic_is_recovered(u in [-1.0..1.0f64, -1.0..1.0, -1.0..1.0, -1.0..1.0, -1.0..1.0, -1.0..1.0, -1.0..1.0]) {
            let mut equations = Equations::default();
            let u = SVector::<f64, 7>::from(u);
            for i in 0..9 {
                let (x, y) = (0.3 * f64::from(i % 3) - 0.25, 0.3 * f64::from(i / 3) - 0.31);
                let [z, p, q] = rows(x, y).map(|row| row.dot(&u));
                equations.add(x, y, z, [p, q]);
            }
            let found = equations.solve().unwrap();
            prop_assert!((Vec3::from(found) - u.fixed_rows::<3>(0)).norm() < 1e-9);
        }

        #[test]
        fn principal_directions_diagonalise(a in -2.0..2.0f64, b in -2.0..2.0f64, c in -2.0..2.0f64) {
            let t = principal(a, b, c, &Vec3::x(), &Vec3::y());
            let k = nalgebra::Matrix2::new(a, b, b, c);
            prop_assert!(t.k1 >= t.k2);
            prop_assert!((k * t.e1.xy() - t.e1.xy() * t.k1).norm() < 1e-12);
            prop_assert!((k * t.e2.xy() - t.e2.xy() * t.k2).norm() < 1e-12);
        }
    }

    #[test]
    fn neighbours_on_a_line_determine_nothing() {
        let mut equations = Equations::default();
        (1..9).for_each(|i| equations.add(f64::from(i) / 9.0, 0.0, 0.0, [0.0, 0.0]));
        assert_eq!(equations.solve(), None);
    }
}
