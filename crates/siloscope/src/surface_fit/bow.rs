//! A cone's generatrix is straight. Where the residuals say that it is not, its slope and vertex are less sure.
//!
//! Feed that lies on the lower cone at nearly its slope, or film on a part of it, leaves a fit between both. The
//! residuals then follow a line with a kink from top to bottom. Which of its parts is the silo's cone they don't tell.

use crate::geometry::parameters::{Information, Parameters};
use crate::geometry::surface::{Cone, Part};
use crate::surface_fit::polish::TileEquation;
use crate::surface_fit::solver::{Fit, tukey};
use nalgebra::{Matrix3, Vector3};

/// How far dents and seams bend a cone, metres.
const FORM: f64 = 1.5e-3;
/// Chi-square of a kink that chance does not reach.
const SURE: f64 = 30.0;
/// The cone's length is cut into so many bands, between which a kink is looked for.
const BANDS: usize = 16;
/// Least slope of a part of the kinked line, as a share of the cone's.
const FLATTEST: f64 = 0.2;
/// Fewest tiles that tell.
const FEWEST: usize = 30;

/// A tile of the cone: its height and its distance from the wall, metres, and its weight, 1/m².
#[derive(Debug, Clone, Copy)]
struct Tile {
    z: f64,
    off: f64,
    weight: f64,
}

/// What a cone's bow adds to the covariance of its slope and intercept.
pub fn bow_uncertainty(fit: &Fit, tiles: &[TileEquation]) -> Information {
    let Some(cone) = fit.surface.cone else { return Information::zeros() };
    let on_cone = tiles.iter().map(|t| &t.equation).filter(|e| e.part == Part::Cone);
    let seen = on_cone.map(|e| {
        let weight = tukey(e.residual * e.residual / e.variance) / (e.variance * e.cosine * e.cosine);
        Tile { z: e.z, off: e.residual * e.cosine, weight }
    });
    let seen: Vec<Tile> = seen.filter(|tile| tile.weight > 0.0).collect();
    if seen.len() < FEWEST { Information::zeros() } else { left_open(&cone, &seen) }
}

/// The cone may be the one that either part of the kinked line belongs to.
fn left_open(cone: &Cone, seen: &[Tile]) -> Information {
    let total: f64 = seen.iter().map(|t| t.weight).sum();
    let middle = seen.iter().map(|t| t.weight * t.z).sum::<f64>() / total;
    let variance = seen.iter().map(|t| t.weight * (t.z - middle).powi(2)).sum::<f64>() / total;
    let length = (12.0 * variance).sqrt();
    let Some(Kinked { at, line: [start, rise, more], mean_square }) = kinked(seen, middle, length) else {
        return Information::zeros();
    };
    let share = (1.0 - FORM * FORM / mean_square).max(0.0).sqrt(); // the rest is the wall's own form
    let across = share * cone.slope.hypot(1.0);
    let steps = [[start, rise], [start - more * at, rise + more]].map(|[start, rise]| {
        let slope = (cone.slope - across * rise / length).max(FLATTEST * cone.slope);
        let mut step = Parameters::zeros();
        step[5] = slope - cone.slope;
        step[6] = step[5] * middle + across * start;
        step
    });
    steps.iter().map(|step| step * step.transpose()).sum()
}

/// A line through the residuals over the place t along the cone, from −1/2 to 1/2: `line[0] + line[1]·t`, and beyond the
/// kink `at` also `line[2]·(t − at)`.
#[derive(Debug, Clone, Copy)]
struct Kinked {
    at: f64,
    line: [f64; 3],
    /// Of what it explains beyond a straight line, m².
    mean_square: f64,
}

/// The best line with a kink; `None` where what it explains beyond a straight one may be chance.
fn kinked(seen: &[Tile], middle: f64, length: f64) -> Option<Kinked> {
    let mut bands = [Sums::default(); BANDS];
    for tile in seen {
        let t = (tile.z - middle) / length;
        let band = ((t + 0.5) * BANDS as f64).clamp(0.0, BANDS as f64 - 1.0);
        bands[band as usize].add(t, tile);
    }
    let all = bands.iter().fold(Sums::default(), Sums::with);
    let beyond = |band: usize| bands[band..].iter().fold(Sums::default(), Sums::with);
    let lines = (1..BANDS).filter_map(|band| {
        let at = band as f64 / BANDS as f64 - 0.5;
        Some((at, all.line(&beyond(band), at)?))
    });
    let (at, Line { line, explained, gain }) = lines.max_by(|a, b| a.1.gain.total_cmp(&b.1.gain))?;
    let scatter = (all.oo - explained) / (seen.len() as f64 - 3.0);
    (gain > SURE * scatter).then(|| Kinked { at, line: line.into(), mean_square: gain / all.w })
}

/// Weighted sums over tiles of powers of their place t and their residual o.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    w: f64,
    t: f64,
    tt: f64,
    o: f64,
    to: f64,
    oo: f64,
}

impl Sums {
    fn add(&mut self, t: f64, tile: &Tile) {
        let (weight, off) = (tile.weight, tile.off);
        self.w += weight;
        self.t += weight * t;
        self.tt += weight * t * t;
        self.o += weight * off;
        self.to += weight * t * off;
        self.oo += weight * off * off;
    }

    fn with(self, other: &Self) -> Self {
        let Self { w, t, tt, o, to, oo } = *other;
        Self { w: self.w + w, t: self.t + t, tt: self.tt + tt, o: self.o + o, to: self.to + to, oo: self.oo + oo }
    }

    /// The line with a kink `at` a place; `beyond` are the tiles beyond it.
    fn line(&self, beyond: &Self, at: f64) -> Option<Line> {
        let one = beyond.t - at * beyond.w;
        let along = beyond.tt - at * beyond.t;
        let square = along - at * one;
        let normal = Matrix3::new(self.w, self.t, one, self.t, self.tt, along, one, along, square);
        let right = Vector3::new(self.o, self.to, beyond.to - at * beyond.o);
        let straight = normal.fixed_view::<2, 2>(0, 0).try_inverse()? * right.fixed_rows::<2>(0);
        let line = normal.try_inverse()? * right;
        let explained = line.dot(&right);
        Some(Line { line, explained, gain: explained - straight.dot(&right.fixed_rows::<2>(0)) })
    }
}

/// A kinked line, what it explains of the residuals, and how much of that a straight one does not.
struct Line {
    line: Vector3<f64>,
    explained: f64,
    gain: f64,
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector2;
    use proptest::prelude::*;

    const NOISE: f64 = 4e-3;

    /// Tiles on a profile ρ(z) from 4 m to 5 m down, and the cone through them by least squares.
    fn cone_through(rho: impl Fn(f64) -> f64, noise: f64) -> (Cone, Vec<Tile>) {
        let heights: Vec<f64> = (0..400).map(|i| 4.0 + f64::from(i) / 400.0).collect();
        let chance = |z: f64| ((z * 12_989.8).sin() * 43_758.545_3).fract() * noise * 3.0_f64.sqrt();
        let radii: Vec<f64> = heights.iter().map(|&z| rho(z) + chance(z)).collect();
        let n = heights.len() as f64;
        let (z, r) = (heights.iter().sum::<f64>() / n, radii.iter().sum::<f64>() / n);
        let product: f64 = heights.iter().zip(&radii).map(|(h, radius)| (h - z) * (radius - r)).sum();
        let slope = -product / heights.iter().map(|h| (h - z).powi(2)).sum::<f64>();
        let cone = Cone { slope, apex: z + r / slope };
        let across = slope.hypot(1.0);
        let off =
            |(&z, &radius): (&f64, &f64)| Tile { z, off: (radius - slope * (cone.apex - z)) / across, weight: 1.0 };
        (cone, heights.iter().zip(&radii).map(off).collect())
    }

    #[test]
    fn a_straight_cone_is_as_sure_as_before() {
        let (cone, seen) = cone_through(|z| 0.9 * (5.6 - z), NOISE);
        assert_eq!(left_open(&cone, &seen), Information::zeros());
    }

    #[test]
    fn dents_and_chance_are_no_kink() {
        let (cone, seen) = cone_through(|z| 0.9 * (5.6 - z) + 1e-3 * (8.0 * z).sin(), NOISE);
        assert_eq!(left_open(&cone, &seen), Information::zeros());
    }

    proptest! {
        #[test]
        fn either_part_of_a_kinked_cone_is_within_the_deviation(
            slope in 0.6f64..1.2, more in 0.15f64..0.5, kink in 4.3f64..4.7,
        ) {
            let upper = Cone { slope, apex: 5.6 };
            let feed = |z: f64| upper.slope * (upper.apex - z) - more * (z - kink).max(0.0);
            let lower = Cone { slope: slope + more, apex: kink + feed(kink) / (slope + more) };
            let (cone, seen) = cone_through(feed, NOISE);
            let spread = left_open(&cone, &seen).fixed_view::<2, 2>(5, 5).into_owned();
            for part in [upper, lower] {
                let off = Vector2::new(part.slope - cone.slope, part.intercept() - cone.intercept());
                let inverse = spread.try_inverse().unwrap_or_default();
                prop_assert!(off.dot(&(inverse * off)) < 4.0, "{off:?} {spread:?}");
            }
            prop_assert!(spread[(0, 0)].sqrt() < more, "{spread:?}");
        }
    }

    #[test]
    fn the_sums_of_bands_tell_what_the_tiles_tell() {
        let (_, seen) = cone_through(|z| 0.9 * (5.6 - z) - 0.2 * (z - 4.375).max(0.0), NOISE);
        let (mut bands, middle, at) = ([Sums::default(); 2], 4.5, -0.125);
        let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
        for tile in &seen {
            let t = tile.z - middle;
            bands[usize::from(t >= at)].add(t, tile);
            let row = Vector3::new(1.0, t, (t - at).max(0.0));
            normal += row * row.transpose();
            right += row * tile.off;
        }
        let plain = normal.try_inverse().map(|inverse| inverse * right);
        let found = bands[0].with(&bands[1]).line(&bands[1], at).map(|found| found.line);
        assert!(plain.zip(found).is_some_and(|(a, b)| (a - b).norm() < 1e-9 * a.norm()), "{plain:?} {found:?}");
    }
}
