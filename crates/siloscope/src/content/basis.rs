//! What a feed surface is made of: a level, a tilt, a profile about a centre, and a smooth rest.
//!
//! In units of the silo's radius, `z(u, v) = a + b u + c v + Σ s_i √(ρ² + t_i²) + Σ κ_k F_k(ρ) + Σ g_j B_j(u, v)`, where ρ
//! is the distance from the heap's centre. Bulk solids lie at about one angle, so the profile is a cone with a more or
//! less rounded tip, bent by a curvature that varies smoothly with ρ (F_k is a hat function integrated twice); the rest
//! is a Matérn field (smoothness 3/2) on a lattice of cubic B-splines. Where nothing is seen the surface goes on with
//! the slope it had, and what it may do instead grows with the distance.

use nalgebra::{DMatrix, Matrix2, Vector2};
use std::sync::OnceLock;

/// Distance between the profile's knots.
const KNOT: f64 = 0.1;
/// Most knots of a profile: those of a heap at the wall.
const MOST_KNOTS: usize = 21;
/// Distance between the lattice's points.
const PITCH: f64 = 1.0 / 3.0;
/// Lattice points along a side: those whose splines reach into [-1, 1].
const SIDE: usize = 9;
/// Lattice points farther out have less than a millionth of a weight in the disc.
const OUTERMOST: f64 = 1.7;
/// Radii over which the tips of the profile's cones are rounded.
const TIPS: [f64; 2] = [0.0, 0.15];
/// Distance over which the curvature changes.
const CHANGE: f64 = 0.4;
/// Standard deviation of the level, of the tilt's slopes, and of the cones' slopes.
const LEVEL: f64 = 10.0;
const TILT: f64 = 0.3;
const SLOPE: f64 = 0.4;
/// Standard deviation of a heap's centre about the axis before anything is seen, in radii.
const OFF_AXIS: f64 = 0.5;
/// Functions before the knots.
const FIRST: usize = 3 + TIPS.len();
/// Functions that are not zero at one place, at most.
const ROW: usize = FIRST + MOST_KNOTS + 16;

/// How much the surface may bend and how irregular it may be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Roughness {
    /// Standard deviation of the profile's curvature, 1/radius.
    pub bend: f64,
    /// Standard deviation of the smooth rest, in radii.
    pub rest: f64,
    /// Over which distance the rest changes: an index into `RANGES`.
    pub range: usize,
}

/// Ranges of the smooth rest, in radii.
pub const RANGES: [f64; 3] = [1.0, 0.45, 0.2];

/// The functions of a surface about one centre.
#[derive(Debug, Clone)]
pub struct Basis {
    /// Centre of the profile, in radii.
    pub centre: [f64; 2],
    knots: usize,
    curvature: Block,
}

/// A precision for a standard deviation of 1, and the logarithm of its determinant.
type Block = (DMatrix<f64>, f64);

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
        let knots = ((reach / KNOT).ceil() as usize + 1).min(MOST_KNOTS);
        let places: Vec<[f64; 2]> = (0..knots).map(|k| [k as f64 * KNOT, 0.0]).collect();
        Self { centre, knots, curvature: matern_precision(&places, CHANGE) }
    }

    /// Number of functions.
    pub fn functions(&self) -> usize {
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

    /// Value of a surface at a place.
    pub fn height(&self, place: [f64; 2], coefficients: &[f64]) -> f64 {
        let mut sum = 0.0;
        self.each(place, |index, [value, _, _]| sum += value * coefficients.get(index).copied().unwrap_or(0.0));
        sum
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
        let square = u * u + v * v;
        let rho = square.sqrt();
        for (i, tip) in TIPS.iter().enumerate() {
            let rounded = (square + tip * tip).sqrt();
            let slope = if rounded > 1e-12 { [u / rounded, v / rounded] } else { [0.0; 2] };
            see(3 + i, [rounded - tip, slope[0], slope[1]]);
        }
        let along = if rho > 1e-12 { [u / rho, v / rho] } else { [0.0; 2] };
        for k in 0..self.knots {
            let Some([value, slope]) = curved(rho / KNOT, k as f64) else { break };
            let (value, slope) = (value * KNOT * KNOT, slope * KNOT);
            see(FIRST + k, [value, slope * along[0], slope * along[1]]);
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
        let n = self.functions();
        let mut q = DMatrix::zeros(n, n);
        let mut log = 0.0;
        for (i, std) in [LEVEL, TILT, TILT].into_iter().chain(TIPS.map(|_| SLOPE)).enumerate() {
            q[(i, i)] = 1.0 / (std * std);
            log -= 2.0 * f64::ln(std);
        }
        let lattice = lattice();
        let rest = &lattice.precisions[roughness.range.min(RANGES.len() - 1)];
        for (first, block, std) in
            [(FIRST, &self.curvature, roughness.bend), (FIRST + self.knots, rest, roughness.rest)]
        {
            let (m, scale) = (block.0.nrows(), 1.0 / (std * std));
            q.view_mut((first, first), (m, m)).copy_from(&(&block.0 * scale));
            log += block.1 + m as f64 * scale.ln();
        }
        (q, log)
    }
}

/// Value and slope at x ≥ 0 of the function whose second derivative is a hat of width 1 about `middle`, and which is
/// level where it begins; None before that.
fn curved(x: f64, middle: f64) -> Option<[f64; 2]> {
    let t = x - middle;
    if t <= -1.0 {
        return None;
    }
    let begun = t + 1.0;
    let [value, slope] = match t {
        _ if t >= 1.0 => [t, 1.0],
        _ if t >= 0.0 => [begun * begun * begun / 6.0 - t * t * t / 3.0, 0.5 * begun * begun - t * t],
        _ => [begun * begun * begun / 6.0, 0.5 * begun * begun],
    };
    // the first hat is cut in two by the centre: what its lost half would add is level and slope there
    Some(if middle == 0.0 { [value - 1.0 / 6.0 - 0.5 * x, slope - 0.5] } else { [value, slope] })
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
    (centre.norm() <= 1.0).then_some(centre.into())
}

/// The lattice's points near the disc, and for each range the precision of a Matérn field of variance 1 on them with
/// the logarithm of its determinant.
struct Lattice {
    points: Vec<[f64; 2]>,
    places: [Option<usize>; SIDE * SIDE],
    precisions: [Block; RANGES.len()],
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
fn matern_precision(points: &[[f64; 2]], range: f64) -> Block {
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
    let i = s.clamp(0.0, (SIDE - 4) as f64) as usize;
    (i, s - i as f64)
}

/// Weights of the uniform cubic B-spline.
fn spline(t: f64) -> [f64; 4] {
    let s = 1.0 - t;
    [s * s * s / 6.0, (t * t * (3.0 * t - 6.0) + 4.0) / 6.0, (s * s * (3.0 * s - 6.0) + 4.0) / 6.0, t * t * t / 6.0]
}

fn spline_slope(t: f64) -> [f64; 4] {
    let s = 1.0 - t;
    [-s * s / 2.0, t * (3.0 * t - 4.0) / 2.0, s * (4.0 - 3.0 * s) / 2.0, t * t / 2.0]
}

#[cfg(test)]
#[allow(clippy::panic)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn slopes_are_the_derivatives(u in -0.9f64..0.9, v in -0.9f64..0.9, seed in 0u64..1000) {
            let basis = Basis::new([0.21, -0.4]);
            let c: Vec<f64> = (0..basis.functions()).map(|i| ((seed + 1) as f64 * (i as f64 + 0.7)).sin()).collect();
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
        assert_eq!(q.nrows(), basis.functions());
        let Some(factor) = q.cholesky() else { panic!("positive definite") };
        assert!((factor.ln_determinant() - log).abs() < 1e-6 * log.abs());
    }

    #[test]
    fn the_row_has_room_for_a_heap_at_the_wall() {
        let basis = Basis::new([1.0, 0.0]);
        let c: Vec<f64> = (0..basis.functions()).map(|i| (i as f64 + 0.3).cos()).collect();
        let place = [-0.99, 0.1];
        assert!((basis.row(place).dot(&c) - basis.jet(place, &c)[0]).abs() < 1e-9);
    }

    #[test]
    fn the_profile_bends_as_its_hats_say() {
        let h = 1e-4;
        for (middle, x) in [(0.0, 0.4), (0.0, 1.3), (3.0, 2.3), (3.0, 3.6), (3.0, 5.5)] {
            let at = |x: f64| curved(x, middle).map_or([0.0; 2], |jet| jet);
            let hat = (1.0 - (x - middle).abs()).max(0.0);
            assert!(((at(x + h)[1] - at(x - h)[1]) / (2.0 * h) - hat).abs() < 1e-6);
            assert!(((at(x + h)[0] - at(x - h)[0]) / (2.0 * h) - at(x)[1]).abs() < 1e-6);
        }
        assert_eq!(curved(0.0, 0.0), Some([0.0, 0.0]));
    }
}
