//! Least squares with a prior: the surface's trend, how sure it is everywhere, and how well it explains the cells.

use super::basis::{Basis, Roughness, Row};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// Height at a place, with the functions of the basis worked out there. In radii.
#[derive(Debug, Clone)]
pub struct Observation {
    /// The basis at the place.
    pub row: Row,
    /// Height.
    pub value: f64,
    /// Variance of the height.
    pub variance: f64,
}

/// Coefficients with their covariance.
#[derive(Debug, Clone)]
pub struct Trend {
    /// One for each function of the basis.
    pub coefficients: DVector<f64>,
    factor: Cholesky<f64, Dyn>,
    /// Logarithm of the density of the observations under the prior, up to a constant.
    pub evidence: f64,
}

/// Sums over the observations: `A = Σ φφᵀ/s`, `b = Σ φz/s`, `Σ z²/s` and `Σ ln s`.
#[derive(Debug, Clone)]
pub struct Sums {
    a: DMatrix<f64>,
    b: DVector<f64>,
    square: f64,
    log: f64,
}

impl Sums {
    /// Adds the observations up; only the lower triangle of `A` is kept.
    pub fn new<'a>(functions: usize, observations: impl IntoIterator<Item = &'a Observation>) -> Self {
        let mut a = DMatrix::<f64>::zeros(functions, functions);
        let mut b = DVector::zeros(functions);
        let (mut square, mut log) = (0.0, 0.0);
        for o in observations {
            let weight = 1.0 / o.variance;
            let columns = a.as_mut_slice();
            for (place, (j, value)) in o.row.iter().enumerate() {
                let scaled = weight * value;
                b[j] += scaled * o.value;
                let Some(column) = columns.get_mut(j * functions..(j + 1) * functions) else { continue };
                for (i, other) in o.row.iter().skip(place) {
                    column[i] += scaled * other; // the row's indices increase, so i >= j
                }
            }
            square += weight * o.value * o.value;
            log += o.variance.ln();
        }
        Self { a, b, square, log }
    }

    /// Most probable coefficients under a prior; None where the numbers are no longer finite.
    pub fn solve(&self, basis: &Basis, roughness: Roughness) -> Option<Trend> {
        let (precision, log) = basis.precision(roughness);
        let factor = (precision + &self.a).cholesky()?;
        let coefficients = factor.solve(&self.b);
        let misfit = self.square - self.b.dot(&coefficients);
        let evidence = -0.5 * (misfit + factor.ln_determinant() - log + self.log);
        evidence.is_finite().then_some(Trend { coefficients, factor, evidence })
    }
}

impl Trend {
    /// Height at a place whose functions are worked out.
    pub fn height(&self, row: &Row) -> f64 {
        row.dot(self.coefficients.as_slice())
    }

    /// Height and its derivatives at a place.
    pub fn jet(&self, basis: &Basis, place: [f64; 2]) -> [f64; 3] {
        basis.jet(place, self.coefficients.as_slice())
    }

    /// Derivatives of the height at a place.
    pub fn slopes(&self, basis: &Basis, place: [f64; 2]) -> [f64; 2] {
        let [_, du, dv] = self.jet(basis, place);
        [du, dv]
    }

    /// Covariance of the coefficients.
    pub fn covariance(&self) -> DMatrix<f64> {
        self.factor.inverse()
    }

    /// The coefficients' covariance times a vector: how each moves when what the vector weighs is wrong.
    pub fn spread(&self, weights: &DVector<f64>) -> DVector<f64> {
        self.factor.solve(weights)
    }
}

/// Variance of the height at a place.
pub fn variance(covariance: &DMatrix<f64>, row: &Row) -> f64 {
    let along = |i: usize| row.iter().map(|(j, value)| covariance[(i, j)] * value).sum::<f64>();
    row.iter().map(|(i, value)| value * along(i)).sum::<f64>().max(0.0)
}

#[cfg(test)]
#[allow(clippy::panic)]
mod tests {
    use super::*;

    const ROUGHNESS: Roughness = Roughness { bend: 0.5, rest: 0.05, range: 0 };

    fn observe(basis: &Basis, places: &[[f64; 2]], height: impl Fn(f64, f64) -> f64) -> Vec<Observation> {
        let at = |&[u, v]: &[f64; 2]| Observation { row: basis.row([u, v]), value: height(u, v), variance: 1e-6 };
        places.iter().map(at).collect()
    }

    fn disc() -> Vec<[f64; 2]> {
        let on = |i: i32| f64::from(i) / 8.0;
        let square = (-8..=8).flat_map(|i| (-8..=8).map(move |j| [on(i), on(j)]));
        square.filter(|[u, v]| u.hypot(*v) < 0.95).collect()
    }

    #[test]
    fn a_tilted_cone_is_reproduced_and_goes_on_unseen() {
        let basis = Basis::new([0.0, 0.0]);
        let height = |u: f64, v: f64| 0.3 - 0.2 * u + 0.1 * v + 0.5 * u.hypot(v);
        let inner: Vec<_> = disc().into_iter().filter(|[u, v]| u.hypot(*v) < 0.5).collect();
        let Some(trend) = Sums::new(basis.functions(), &observe(&basis, &inner, height)).solve(&basis, ROUGHNESS)
        else {
            panic!("solvable")
        };
        for place in disc() {
            let error = trend.height(&basis.row(place)) - height(place[0], place[1]);
            assert!(error.abs() < 0.02, "{error} at {place:?}");
        }
    }

    #[test]
    fn doubt_grows_away_from_what_is_seen() {
        let basis = Basis::new([0.0, 0.0]);
        let seen: Vec<_> = disc().into_iter().filter(|[u, _]| *u < 0.0).collect();
        let observations = observe(&basis, &seen, |u, _| 0.1 * u);
        let Some(trend) = Sums::new(basis.functions(), &observations).solve(&basis, ROUGHNESS) else {
            panic!("solvable")
        };
        let covariance = trend.covariance();
        let std = |u: f64| variance(&covariance, &basis.row([u, 0.0])).sqrt();
        assert!(std(-0.5) < 1e-3 && std(0.3) > std(0.1) && std(0.9) > std(0.3));
    }

    #[test]
    fn evidence_prefers_the_roughness_that_is_there() {
        let basis = Basis::new([0.0, 0.0]);
        let wavy = |u: f64, v: f64| 0.1 * (5.0 * u).sin() * (4.0 * v).cos();
        let evidence = |height: &dyn Fn(f64, f64) -> f64, rest: f64| {
            let sums = Sums::new(basis.functions(), &observe(&basis, &disc(), height));
            sums.solve(&basis, Roughness { bend: 0.3, rest, range: 0 }).map(|t| t.evidence).unwrap_or(f64::NAN)
        };
        assert!(evidence(&wavy, 0.1) > evidence(&wavy, 0.003));
        assert!(evidence(&|u, v| 0.3 * u.hypot(v), 0.1) < evidence(&|u, v| 0.3 * u.hypot(v), 0.003));
    }
}
