//! What a feed surface is made of: a level, a tilt, a profile about a centre, and a smooth rest.
//!
//! In units of the silo's radius, `z(u, v) = a + b u + c v + s ρ + Σ δ_k (ρ - ρ_k)₊ + Σ g_j B_j(u, v)`, where ρ is the
//! distance from the heap's centre. Bulk solids lie at about one angle, so the profile's slope is a random walk over ρ;
//! the rest is a Matérn field (smoothness 3/2, range one radius) on a lattice of cubic B-splines. Where nothing is seen
//! the surface goes on with the slope it had, and what it may do instead grows with the distance.

use nalgebra::{DMatrix, Matrix2, Vector2};
use std::sync::OnceLock;

/// Distance between the profile's knots.
const KNOT: f64 = 0.1;
/// Most knots of a profile: those of a heap at the wall.
const MOST_KNOTS: usize = 20;
/// Distance between the lattice's points.
const PITCH: f64 = 1.0 / 3.0;
/// Lattice points along a side: those whose splines reach into [-1, 1].
const SIDE: usize = 9;
/// Lattice points farther out have less than a millionth of a weight in the disc.
const OUTERMOST: f64 = 1.7;
/// Standard deviation of the level, of the tilt's slopes, and of the profile's slope at the centre.
const LEVEL: f64 = 10.0;
const TILT: f64 = 0.3;
const SLOPE: f64 = 0.5;
/// Standard deviation of a heap's centre about the axis before anything is seen, in radii.
const OFF_AXIS: f64 = 0.5;
/// Functions before the knots.
const FIRST: usize = 4;
/// Functions that are not zero at one place, at most.
const ROW: usize = FIRST + MOST_KNOTS + 16;

/// How much the surface may bend and how irregular it may be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Roughness {
    /// Standard deviation of the change of the profile's slope over one radius.
    pub bend: f64,
    /// Standard deviation of the smooth rest, in radii.
    pub rest: f64,
    /// Over which distance the rest changes: an index into `RANGES`.
    pub range: usize,
}

/// Ranges of the smooth rest, in radii.
pub const RANGES: [f64; 2] = [1.0, 0.45];

/// The functions of a surface about one centre.
#[derive(Debug, Clone, PartialEq)]
pub struct Basis {
    /// Centre of the profile, in radii.
    pub centre: [f64; 2],
    knots: usize,
}

/// The functions that are not zero at a place, by increasing index.
#[derive(Debug, Clone)]
pub struct Row {
    len: usize,
    index: [u16; ROW],
    value: [f64; ROW],
}

impl Row {
    /// Index and value of each function.
    pub fn iter(&self) -> impl Iterator<Item = (usize, f64)> {
        self.index.iter().map(|&i| usize::from(i)).zip(self.value.iter().copied()).take(self.len)
    }

    /// Value of a surface.
    pub fn dot(&self, coefficients: &[f64]) -> f64 {
        self.iter().map(|(i, value)| value * coefficients.get(i).copied().unwrap_or(0.0)).sum()
    }
}

impl Basis {
    /// The functions of a surface whose profile has its centre at most one radius from the axis.
    pub fn new(centre: [f64; 2]) -> Self {
        let reach = 1.0 + centre[0].hypot(centre[1]);
        let knots = ((reach / KNOT).ceil() as usize).saturating_sub(1).min(MOST_KNOTS);
        Self { centre, knots }
    }

    /// Number of functions.
    pub fn len(&self) -> usize {
        FIRST + self.knots + lattice().points.len()
    }

    /// The functions at a place.
    pub fn row(&self, place: [f64; 2]) -> Row {
        let mut row = Row { len: 0, index: [0; ROW], value: [0.0; ROW] };
        self.each(place, |index, [value, _, _]| {
            if let (Some(i), Some(v)) = (row.index.get_mut(row.len), row.value.get_mut(row.len)) {
                (*i, *v) = (index as u16, value);
                row.len += 1;
            }
        });
        row
    }

    /// Value of a surface at a place, and its derivatives along u and v.
    pub fn jet(&self, place: [f64; 2], coefficients: &[f64]) -> [f64; 3] {
        let mut sum = [0.0; 3];
        self.each(place, |index, jet| {
            let c = coefficients.get(index).copied().unwrap_or(0.0);
            sum.iter_mut().zip(jet).for_each(|(sum, part)| *sum += c * part);
        });
        sum
    }

    /// Calls `see` with index, value and derivatives of each function that is not zero at a place.
    #[inline]
    fn each(&self, [u, v]: [f64; 2], mut see: impl FnMut(usize, [f64; 3])) {
        see(0, [1.0, 0.0, 0.0]);
        see(1, [u, 1.0, 0.0]);
        see(2, [v, 0.0, 1.0]);
        self.profile([u - self.centre[0], v - self.centre[1]], &mut see);
        self.rest([u, v], &mut see);
    }

    #[inline]
    fn profile(&self, [u, v]: [f64; 2], see: &mut impl FnMut(usize, [f64; 3])) {
        let rho = (u * u + v * v).sqrt();
        let slope = if rho > 1e-12 { [u / rho, v / rho] } else { [0.0; 2] };
        for k in 0..=self.knots {
            let beyond = rho - k as f64 * KNOT;
            if beyond <= 0.0 && k > 0 {
                break;
            }
            see(FIRST - 1 + k, [beyond, slope[0], slope[1]]);
        }
    }

    #[inline]
    fn rest(&self, [u, v]: [f64; 2], see: &mut impl FnMut(usize, [f64; 3])) {
        let lattice = lattice();
        let ((column, x), (line, y)) = (cell(u), cell(v));
        let (wx, sx, wy, sy) = (spline(x), spline_slope(x), spline(y), spline_slope(y));
        for j in 0..4 {
            for i in 0..4 {
                if let Some(place) = lattice.place(column + i, line + j) {
                    let jet = [wx[i] * wy[j], sx[i] * wy[j] / PITCH, wx[i] * sy[j] / PITCH];
                    see(FIRST + self.knots + place, jet);
                }
            }
        }
    }

    /// Precision of the coefficients before anything is seen, and the logarithm of its determinant.
    pub fn precision(&self, roughness: Roughness) -> (DMatrix<f64>, f64) {
        let n = self.len();
        let mut q = DMatrix::zeros(n, n);
        let bend = 1.0 / (roughness.bend * roughness.bend * KNOT);
        let first = [LEVEL, TILT, TILT, SLOPE].map(|std: f64| 1.0 / (std * std));
        let diagonal = first.into_iter().chain(std::iter::repeat_n(bend, self.knots));
        let mut log = 0.0;
        for (i, value) in diagonal.enumerate() {
            q[(i, i)] = value;
            log += value.ln();
        }
        let lattice = lattice();
        let m = lattice.points.len();
        let scale = 1.0 / (roughness.rest * roughness.rest);
        let (precision, determinant) = &lattice.precisions[roughness.range.min(RANGES.len() - 1)];
        q.view_mut((n - m, n - m), (m, m)).copy_from(&(precision * scale));
        (q, log + determinant + m as f64 * scale.ln())
    }
}

/// Where the lines of steepest slope meet, in radii, given places and slopes there: least squares over the lines' distances, steep places counting more.
pub fn meeting_point(slopes: impl Iterator<Item = ([f64; 2], [f64; 2])>) -> Option<[f64; 2]> {
    let (mut a, mut b) = (Matrix2::zeros(), Vector2::zeros());
    let mut steepness = 0.0;
    for (place, [zx, zy]) in slopes {
        let across = Vector2::new(-zy, zx);
        a += across * across.transpose();
        b += across * across.dot(&Vector2::from(place));
        steepness += across.norm_squared();
    }
    // a line is known to a tenth of a radius; the prior keeps the centre of a plane at the axis
    a += Matrix2::identity() * (0.01 / (OFF_AXIS * OFF_AXIS) * steepness);
    let centre: Vector2<f64> = a.lu().solve(&b)?;
    (centre.norm() <= 1.0 && centre.norm() > 0.01).then_some(centre.into())
}

/// The lattice's points near the disc, and for each range the precision of a Matérn field of variance 1 on them with
/// the logarithm of its determinant.
struct Lattice {
    points: Vec<[f64; 2]>,
    places: [Option<usize>; SIDE * SIDE],
    precisions: [(DMatrix<f64>, f64); RANGES.len()],
}

impl Lattice {
    fn place(&self, column: usize, line: usize) -> Option<usize> {
        self.places.get(line * SIDE + column).copied().flatten()
    }
}

/// The same for all surfaces, so it is worked out once.
fn lattice() -> &'static Lattice {
    static LATTICE: OnceLock<Lattice> = OnceLock::new();
    LATTICE.get_or_init(|| {
        let at = |i: usize| i as f64 * PITCH - 1.0 - PITCH;
        let (mut points, mut places) = (Vec::new(), [None; SIDE * SIDE]);
        for (i, place) in places.iter_mut().enumerate() {
            let point = [at(i % SIDE), at(i / SIDE)];
            if point[0].hypot(point[1]) <= OUTERMOST {
                *place = Some(points.len());
                points.push(point);
            }
        }
        let precisions = RANGES.map(|range| matern_precision(&points, range));
        Lattice { points, places, precisions }
    })
}

/// Inverse of `k(d) = (1 + √3 d/range) exp(-√3 d/range)` between the points, and the logarithm of the inverse's determinant.
fn matern_precision(points: &[[f64; 2]], range: f64) -> (DMatrix<f64>, f64) {
    let n = points.len();
    let covariance = DMatrix::from_fn(n, n, |i, j| {
        let (a, b) = (points[i], points[j]);
        let d = 3f64.sqrt() / range * (a[0] - b[0]).hypot(a[1] - b[1]);
        (1.0 + d) * (-d).exp()
    });
    match covariance.cholesky() {
        Some(factor) => (factor.inverse(), -factor.ln_determinant()),
        None => (DMatrix::identity(n, n), 0.0), // a Matérn matrix of distinct points always has a factor
    }
}

/// Lattice interval of a coordinate and the place in it; outside [-1, 1] the edge's polynomial goes on.
fn cell(u: f64) -> (usize, f64) {
    let s = (u + 1.0) / PITCH;
    let i = s.clamp(0.0, (SIDE - 4) as f64).floor();
    (i as usize, s - i)
}

/// Weights of the uniform cubic B-spline.
fn spline(t: f64) -> [f64; 4] {
    let s = 1.0 - t;
    [
        s * s * s / 6.0,
        (t * t * (3.0 * t - 6.0) + 4.0) / 6.0,
        (s * s * (3.0 * s - 6.0) + 4.0) / 6.0,
        t * t * t / 6.0,
    ]
}

fn spline_slope(t: f64) -> [f64; 4] {
    let s = 1.0 - t;
    [-s * s / 2.0, t * (3.0 * t - 4.0) / 2.0, s * (4.0 - 3.0 * s) / 2.0, t * t / 2.0]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn slopes_are_the_derivatives(u in -0.9f64..0.9, v in -0.9f64..0.9, seed in 0u64..1000) {
            let basis = Basis::new([0.21, -0.4]);
            let c: Vec<f64> = (0..basis.len()).map(|i| ((seed + 1) as f64 * (i as f64 + 0.7)).sin()).collect();
            let rho = (u - 0.21).hypot(v + 0.4);
            prop_assume!((rho / KNOT - (rho / KNOT).round()).abs() > 1e-3);
            let at = |u, v| basis.row([u, v]).dot(&c);
            let [value, du, dv] = basis.jet([u, v], &c);
            prop_assert!((value - at(u, v)).abs() < 1e-9);
            let h = 1e-6;
            prop_assert!((du - (at(u + h, v) - at(u - h, v)) / (2.0 * h)).abs() < 1e-5);
            prop_assert!((dv - (at(u, v + h) - at(u, v - h)) / (2.0 * h)).abs() < 1e-5);
        }

        #[test]
        fn splines_add_up_to_one(u in -1.0f64..1.0, v in -1.0f64..1.0) {
            let basis = Basis::new([0.0, 0.0]);
            let sum: f64 = basis.row([u, v]).iter().filter(|(i, _)| *i >= FIRST + basis.knots).map(|(_, b)| b).sum();
            prop_assume!(u.hypot(v) < 1.0);
            prop_assert!((sum - 1.0).abs() < 1e-6);
        }
    }

    #[test]
    fn the_precision_has_the_determinant_it_says() {
        let basis = Basis::new([0.0, 0.0]);
        let (q, log) = basis.precision(Roughness { bend: 0.4, rest: 0.03, range: 1 });
        assert_eq!(q.nrows(), basis.len());
        let Some(factor) = q.cholesky() else { panic!("positive definite") };
        assert!((factor.ln_determinant() - log).abs() < 1e-6 * log.abs());
    }

    #[test]
    fn the_row_has_room_for_a_heap_at_the_wall() {
        let basis = Basis::new([1.0, 0.0]);
        assert_eq!(basis.knots, 19);
        assert!(basis.row([-0.99, 0.0]).len < ROW);
    }
}
