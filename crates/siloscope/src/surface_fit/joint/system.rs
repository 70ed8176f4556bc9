//! Normal equations of all parameters from rows of the two parts, with a Gaussian prior.

use crate::geometry::surface::Part;
use crate::surface_fit::joint::parameters::{COMMON, CYLINDER_END, SIZE};
use crate::surface_fit::joint::predict::own_columns;
use nalgebra::{DMatrix, DVector};

/// Widths of a part's rows.
const WIDTHS: [usize; 2] = [CYLINDER_END, COMMON + SIZE - CYLINDER_END];

/// Which of all parameters is a part's column `k`.
pub fn column(part: Part, k: usize) -> usize {
    if k < COMMON { k } else { own_columns(part) + k - COMMON }
}

/// Sum of squares ½ δᵀ H δ + gᵀ δ of a frame, over all parameters, without priors.
#[derive(Debug, Clone)]
pub struct Quadratic {
    /// H, the information.
    pub information: DMatrix<f64>,
    /// g, the gradient.
    pub gradient: DVector<f64>,
    /// What of both the tiles of cylinder and cone say, each in its part's own columns.
    pub parts: [PartSum; 2],
}

/// The sum of squares of one part's tiles, in the part's columns.
#[derive(Debug, Clone, Default)]
pub struct PartSum {
    /// The information, row by row.
    pub information: Vec<f64>,
    /// The gradient.
    pub gradient: Vec<f64>,
}

impl PartSum {
    /// From the upper triangle of the information.
    fn of_upper(mut information: Vec<f64>, gradient: Vec<f64>) -> Self {
        let n = gradient.len();
        for r in 0..n {
            for c in 0..r {
                information[r * n + c] = information[c * n + r];
            }
        }
        Self { information, gradient }
    }

    fn shift(&mut self, step: impl Fn(usize) -> f64, factor: f64) {
        let step: Vec<f64> = (0..self.gradient.len()).map(|k| factor * step(k)).collect();
        for (g, row) in self.gradient.iter_mut().zip(self.information.chunks_exact(step.len())) {
            *g += dot(row, &step);
        }
    }
}

/// Rows that are added to the sums together.
const BATCH: usize = 4;

/// Rows added up by part.
#[derive(Debug, Clone)]
pub struct Accumulator {
    sums: [Vec<f64>; 2],
    gradients: [Vec<f64>; 2],
    waiting: [Vec<[f64; CYLINDER_END]>; 2],
}

impl Default for Accumulator {
    fn default() -> Self {
        let waiting = || Vec::with_capacity(BATCH);
        Self {
            sums: WIDTHS.map(|n| vec![0.0; n * n]),
            gradients: WIDTHS.map(|n| vec![0.0; n]),
            waiting: [waiting(), waiting()],
        }
    }
}

impl Accumulator {
    /// Adds a row of a part with its residual and weight (1/m²).
    #[inline]
    pub fn add(&mut self, part: Part, row: &[f64], residual: f64, weight: f64) {
        let p = usize::from(part == Part::Cone);
        let (root, mut scaled) = (weight.sqrt(), [0.0; CYLINDER_END]);
        scaled.iter_mut().zip(row).for_each(|(scaled, value)| *scaled = root * value);
        let residual = root * residual;
        self.gradients[p].iter_mut().zip(&scaled).for_each(|(sum, value)| *sum += value * residual);
        self.waiting[p].push(scaled);
        if self.waiting[p].len() == BATCH {
            self.add_waiting(p);
        }
    }

    /// Adds the products of the rows that wait: all at once, so that each sum is read and written once for them.
    fn add_waiting(&mut self, p: usize) {
        let width = WIDTHS[p];
        self.waiting[p].resize(BATCH, [0.0; CYLINDER_END]);
        if let [a, b, c, d] = self.waiting[p].as_slice() {
            for (k, sums) in self.sums[p].chunks_exact_mut(width).enumerate() {
                let factors = [a[k], b[k], c[k], d[k]];
                if factors == [0.0; BATCH] {
                    continue;
                }
                let others = a[k..].iter().zip(&b[k..]).zip(&c[k..]).zip(&d[k..]);
                for (sum, (((a, b), c), d)) in sums[k..].iter_mut().zip(others) {
                    *sum += (factors[0] * a + factors[1] * b) + (factors[2] * c + factors[3] * d);
                }
            }
        }
        self.waiting[p].clear();
    }

    /// The sums over all parameters.
    pub fn quadratic(mut self) -> Quadratic {
        (0..2).for_each(|p| self.add_waiting(p));
        let mut information = DMatrix::zeros(SIZE, SIZE);
        let mut gradient = DVector::zeros(SIZE);
        for (p, part) in [Part::Cylinder, Part::Cone].into_iter().enumerate() {
            let width = WIDTHS[p];
            for k in 0..width {
                gradient[column(part, k)] += self.gradients[p][k];
                for l in k..width {
                    information[(column(part, k), column(part, l))] += self.sums[p][k * width + l];
                }
            }
        }
        information.fill_lower_triangle_with_upper_triangle();
        let parts = [0, 1].map(|p| PartSum::of_upper(self.sums[p].clone(), self.gradients[p].clone()));
        Quadratic { information, gradient, parts }
    }
}

/// Independent Gaussian priors: mean and standard deviation; 0 where a parameter is fixed.
#[derive(Debug, Clone, PartialEq)]
pub struct Prior {
    /// Means.
    pub mean: [f64; SIZE],
    /// Standard deviations.
    pub std: [f64; SIZE],
}

/// The posterior of the free parameters near a linearisation point.
#[derive(Debug, Clone)]
pub struct Posterior {
    /// Step from the linearisation point to the posterior mean.
    pub step: [f64; SIZE],
    /// The free parameters.
    pub free: Vec<usize>,
    /// ln of what the data and the prior leave of the prior's volume, at the posterior mean:
    /// −(½ δᵀHδ + gᵀδ) − ½ |prior deviation|² − ½ ln |I + S^½ H S^½|.
    pub log_evidence: f64,
    factor: Triangle,
    scale: Vec<f64>,
}

impl Quadratic {
    /// Moves the point about which the gradient is by a multiple of a step.
    pub fn shift(&mut self, step: &[f64; SIZE], factor: f64) {
        for (part, sum) in [Part::Cylinder, Part::Cone].into_iter().zip(&mut self.parts) {
            sum.shift(|k| step[column(part, k)], factor);
        }
        let step = DVector::from_row_slice(step) * factor;
        self.gradient += &self.information * step;
    }

    /// So many times what it says; of both parts together alone.
    pub fn times(&self, factor: f64) -> Self {
        Self {
            information: &self.information * factor,
            gradient: &self.gradient * factor,
            parts: [PartSum::default(), PartSum::default()],
        }
    }

    /// Posterior with a prior, from a linearisation point; `None` where the equations are not finite.
    pub fn posterior(&self, at: &[f64; SIZE], prior: &Prior) -> Option<Posterior> {
        let free: Vec<usize> = (0..SIZE).filter(|&k| prior.std[k] > 0.0).collect();
        let scale: Vec<f64> = free.iter().map(|&k| prior.std[k]).collect();
        let n = free.len();
        let mut scaled = vec![0.0; n * n];
        for r in 0..n {
            for c in 0..=r {
                let unit = if r == c { 1.0 } else { 0.0 };
                scaled[r * n + c] = self.information[(free[r], free[c])] * scale[r] * scale[c] + unit;
            }
        }
        let off: Vec<f64> = (0..n).map(|r| (at[free[r]] - prior.mean[free[r]]) / scale[r]).collect();
        let pull: Vec<f64> = (0..n).map(|r| scale[r] * self.gradient[free[r]]).collect();
        let right: Vec<f64> = pull.iter().zip(&off).map(|(pull, off)| -pull - off).collect();
        let factor = Triangle::of(scaled, n)?;
        let step = factor.solve(&right);
        let squares: f64 = off.iter().zip(&step).map(|(off, step)| (off + step).powi(2)).sum();
        // (I + S) δ = right, so that δᵀSδ = δᵀright − δᵀδ
        let bent: f64 = step.iter().zip(&right).map(|(s, r)| s * r - s * s).sum();
        let data = 0.5 * bent + step.iter().zip(&pull).map(|(s, p)| s * p).sum::<f64>();
        let log_evidence = -data - 0.5 * squares - factor.half_log_determinant();
        let mut full = [0.0; SIZE];
        free.iter().enumerate().for_each(|(r, &k)| full[k] = step[r] * scale[r]);
        let finite = log_evidence.is_finite() && full.iter().all(|s| s.is_finite());
        finite.then_some(Posterior { step: full, free, log_evidence, factor, scale })
    }
}

impl Posterior {
    /// Covariance over all parameters; zero where fixed.
    pub fn covariance(&self) -> DMatrix<f64> {
        let (n, inverse) = (self.free.len(), self.factor.inverse());
        let mut covariance = DMatrix::zeros(SIZE, SIZE);
        for r in 0..n {
            for c in r..n {
                // (L Lᵀ)⁻¹ = L⁻ᵀ L⁻¹, over the rows from the later of both columns on
                let value: f64 = (c..n).map(|k| inverse[k * n + r] * inverse[k * n + c]).sum::<f64>()
                    * self.scale[r]
                    * self.scale[c];
                covariance[(self.free[r], self.free[c])] = value;
                covariance[(self.free[c], self.free[r])] = value;
            }
        }
        covariance
    }

    /// Posterior over prior variance of every parameter; 1 where fixed.
    pub fn shrinkage(&self) -> [f64; SIZE] {
        let (n, inverse) = (self.free.len(), self.factor.inverse());
        let mut sums = vec![0.0; n];
        for row in inverse.chunks_exact(n.max(1)) {
            sums.iter_mut().zip(row).for_each(|(sum, value)| *sum += value * value);
        }
        let mut ratio = [1.0; SIZE];
        self.free.iter().zip(sums).for_each(|(&k, sum)| ratio[k] = sum);
        ratio
    }
}

/// A Cholesky factor L, row by row.
#[derive(Debug, Clone)]
struct Triangle {
    n: usize,
    rows: Vec<f64>,
}

impl Triangle {
    /// Of a symmetric matrix whose lower triangle is given; `None` where it is not positive definite.
    fn of(mut rows: Vec<f64>, n: usize) -> Option<Self> {
        for r in 0..n {
            let (before, row) = rows.split_at_mut(r * n);
            for c in 0..r {
                let other = &before[c * n..c * n + n];
                let dot: f64 = dot(&row[..c], &other[..c]);
                row[c] = (row[c] - dot) / other[c];
            }
            let left = row[r] - dot(&row[..r], &row[..r]);
            if left.is_nan() || left <= 0.0 {
                return None;
            }
            row[r] = left.sqrt();
            row[r + 1..n].fill(0.0);
        }
        Some(Self { n, rows })
    }

    fn half_log_determinant(&self) -> f64 {
        (0..self.n).map(|r| self.rows[r * self.n + r].ln()).sum()
    }

    /// Solution of L Lᵀ x = b.
    fn solve(&self, b: &[f64]) -> Vec<f64> {
        let n = self.n;
        let mut x = b.to_vec();
        for r in 0..n {
            let row = &self.rows[r * n..r * n + n];
            x[r] = (x[r] - dot(&row[..r], &x[..r])) / row[r];
        }
        for r in (0..n).rev() {
            let row = &self.rows[r * n..r * n + n];
            let value = x[r] / row[r];
            x[r] = value;
            x[..r].iter_mut().zip(row).for_each(|(x, l)| *x -= l * value);
        }
        x
    }

    /// L⁻¹, row by row.
    fn inverse(&self) -> Vec<f64> {
        let n = self.n;
        let mut inverse = vec![0.0; n * n];
        for r in 0..n {
            let (before, row) = inverse.split_at_mut(r * n);
            let own = &self.rows[r * n..r * n + n];
            for k in 0..r {
                let factor = -own[k];
                row[..=k].iter_mut().zip(&before[k * n..]).for_each(|(sum, value)| *sum += factor * value);
            }
            let unit = 1.0 / own[r];
            row[..r].iter_mut().for_each(|value| *value *= unit);
            row[r] = unit;
        }
        inverse
    }
}

/// Inner product of equal lengths, four sums side by side: the order is fixed, so that the result is.
#[inline]
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    let ((a4, a), (b4, b)) = (a.as_chunks::<4>(), b.as_chunks::<4>());
    let mut sums = [0.0; 4];
    for (a, b) in a4.iter().zip(b4) {
        (0..4).for_each(|k| sums[k] += a[k] * b[k]);
    }
    sums.iter().sum::<f64>() + a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_posterior_is_that_of_dense_algebra() {
        let mut sums = Accumulator::default();
        let value = |i: usize, k: usize| ((i * 31 + k * 17) as f64).sin();
        for i in 0..200 {
            let part = if i % 2 == 0 { Part::Cylinder } else { Part::Cone };
            let row: Vec<f64> = (0..WIDTHS[i % 2]).map(|k| value(i, k)).collect();
            sums.add(part, &row, value(i, 99), 3.0);
        }
        let quadratic = sums.quadratic();
        let mut prior = Prior { mean: [0.1; SIZE], std: [0.5; SIZE] };
        prior.std[3] = 0.0;
        let at = [0.2; SIZE];
        let found = quadratic.posterior(&at, &prior).expect("positive definite");
        let free: Vec<usize> = (0..SIZE).filter(|k| *k != 3).collect();
        let n = free.len();
        let h =
            DMatrix::from_fn(n, n, |r, c| quadratic.information[(free[r], free[c])] + if r == c { 4.0 } else { 0.0 });
        let g = DVector::from_fn(n, |r, _| quadratic.gradient[free[r]] + 4.0 * 0.1);
        let inverse = h.clone().try_inverse().expect("regular");
        let step = -(&inverse * g);
        let (covariance, shrinkage) = (found.covariance(), found.shrinkage());
        for r in 0..n {
            assert!((found.step[free[r]] - step[r]).abs() < 1e-9);
            assert!((shrinkage[free[r]] - 4.0 * inverse[(r, r)]).abs() < 1e-9);
            assert!((0..n).all(|c| (covariance[(free[r], free[c])] - inverse[(r, c)]).abs() < 1e-9));
        }
        assert!(found.step[3] == 0.0 && covariance[(3, 3)] == 0.0);
        let half_log_det: f64 = 0.5 * (h * 0.25).determinant().ln();
        let off = DVector::from_fn(n, |r, _| (0.1 + step[r]) / 0.5);
        let moved = DVector::from_fn(SIZE, |k, _| found.step[k]);
        let data = 0.5 * moved.dot(&(&quadratic.information * &moved)) + quadratic.gradient.dot(&moved);
        assert!((found.log_evidence + data + 0.5 * off.norm_squared() + half_log_det).abs() < 1e-8);
    }
}
