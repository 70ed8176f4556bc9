//! The shape of a surface: how steep it lies, whether it is a heap or a funnel, and about which centre.

use super::basis::meeting_point;
use super::cells::Cell;
use super::detail;
use super::fit::Surface;
use super::trend::Observation;
use crate::stats::line_fit::LineFit;

/// Shape of the seen part of a surface; heights upwards.
pub fn shape_of(surface: &Surface, cells: &[Cell], reach: f64) -> Option<Shape> {
    let sample = |((i, o), [zx, zy]): (&(usize, Observation), &[f64; 2])| {
        let [x, y, _] = cells[*i].mean;
        let z = surface.datum + surface.trend.height(&o.row) * surface.grid.reach;
        let detail = detail::between(&surface.grid, &surface.detail, x, y);
        Sample { place: [x, y], height: -(z + detail), slope: [-zx, -zy] }
    };
    let samples: Vec<Sample> = surface.used.iter().zip(&surface.slopes).map(sample).collect();
    shape(&samples, surface.grid.centre, reach)
}

/// A place on the surface with its height (upwards) and slopes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// x and y.
    pub place: [f64; 2],
    /// Height.
    pub height: f64,
    /// Rise along x and y.
    pub slope: [f64; 2],
}

/// What the surface looks like as a whole.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Form {
    /// Level.
    Flat,
    /// A plane that is not level.
    Tilted,
    /// Falls away from a centre on all sides.
    Mound,
    /// Rises from a centre on all sides.
    Funnel,
    /// None of these.
    Irregular,
}

/// Shape of a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shape {
    /// What it looks like.
    pub form: Form,
    /// Mean rise of the flank away from the centre; negative for a mound. Its arctangent is the angle of repose.
    pub flank: f64,
    /// Mean steepness of the surface, whatever its direction.
    pub steepness: f64,
    /// Where the lines of steepest slope meet; None where they don't.
    pub centre: Option<[f64; 2]>,
    /// Rise of the mean plane along x and y.
    pub tilt: [f64; 2],
    /// Share of the height's variance that a profile about the axis does not explain.
    pub asymmetry: f64,
    /// Share of it that a profile about the centre does not explain.
    pub irregularity: f64,
}

/// Tangent below which a surface is called level: 3°.
const LEVEL: f64 = 0.052;
/// A form is given its name where it leaves less than this share of the variance unexplained.
const EXPLAINED: f64 = 0.25;
/// The flank lies between these shares of the profile's rise.
const FLANK: [f64; 2] = [0.05, 0.95];
/// Rings of a profile.
const RINGS: usize = 16;
/// Fewest samples that have a shape.
const FEWEST: usize = 12;

/// Finds the shape; `reach` is the radius of the region, about which `axis` is the centre.
pub fn shape(samples: &[Sample], axis: [f64; 2], reach: f64) -> Option<Shape> {
    if samples.len() < FEWEST || reach.is_nan() || reach <= 0.0 {
        return None;
    }
    let n = samples.len() as f64;
    let mean = samples.iter().map(|s| s.height).sum::<f64>() / n;
    let variance = samples.iter().map(|s| (s.height - mean).powi(2)).sum::<f64>() / n;
    let unit = |p: [f64; 2]| [(p[0] - axis[0]) / reach, (p[1] - axis[1]) / reach];
    let centre = meeting_point(samples.iter().map(|s| (unit(s.place), s.slope)))
        .map(|c| [axis[0] + c[0] * reach, axis[1] + c[1] * reach]);
    let left = |about: [f64; 2]| Profile::new(samples, about).unexplained(samples) / variance.max(1e-12);
    let irregularity = centre.map_or(1.0, left);
    let tilt = [0, 1].map(|k| samples.iter().map(|s| s.slope[k]).sum::<f64>() / n);
    let flank = Profile::new(samples, centre.unwrap_or(axis)).flank(samples);
    let steepness = samples.iter().map(|s| s.slope[0].hypot(s.slope[1])).sum::<f64>() / n;
    let plane = planeness(samples, mean, tilt) / variance.max(1e-12);
    let form = form(steepness, flank, irregularity, plane);
    Some(Shape { form, flank, steepness, centre, tilt, asymmetry: left(axis).min(1.0), irregularity })
}

fn form(steepness: f64, flank: f64, irregularity: f64, plane: f64) -> Form {
    if steepness < LEVEL {
        Form::Flat
    } else if plane < irregularity && plane < EXPLAINED {
        Form::Tilted
    } else if irregularity < EXPLAINED && flank.abs() >= LEVEL {
        if flank > 0.0 { Form::Funnel } else { Form::Mound }
    } else {
        Form::Irregular
    }
}

/// Variance that the mean plane leaves.
fn planeness(samples: &[Sample], mean: f64, tilt: [f64; 2]) -> f64 {
    let n = samples.len() as f64;
    let middle = [0, 1].map(|k| samples.iter().map(|s| s.place[k]).sum::<f64>() / n);
    let plane = |s: &Sample| mean + tilt[0] * (s.place[0] - middle[0]) + tilt[1] * (s.place[1] - middle[1]);
    samples.iter().map(|s| (s.height - plane(s)).powi(2)).sum::<f64>() / n
}

/// Mean heights of rings about a centre.
struct Profile {
    centre: [f64; 2],
    width: f64,
    heights: Vec<Option<f64>>,
}

impl Profile {
    fn new(samples: &[Sample], centre: [f64; 2]) -> Self {
        let far = samples.iter().map(|s| distance(s, centre)).fold(0.0, f64::max);
        let width = (far / RINGS as f64).max(1e-9);
        let mut sums = vec![(0.0, 0.0); RINGS + 1];
        for s in samples {
            let ring = ((distance(s, centre) / width) as usize).min(RINGS);
            sums[ring].0 += s.height;
            sums[ring].1 += 1.0;
        }
        let heights = sums.into_iter().map(|(sum, n)| (n > 0.0).then_some(sum / n)).collect();
        Self { centre, width, heights }
    }

    /// Variance that the profile, linear between the rings' middles, leaves.
    fn unexplained(&self, samples: &[Sample]) -> f64 {
        let left = |s: &Sample| (s.height - self.at(distance(s, self.centre))).powi(2);
        samples.iter().map(left).sum::<f64>() / samples.len() as f64
    }

    fn at(&self, rho: f64) -> f64 {
        let place = (rho / self.width - 0.5).clamp(0.0, (RINGS - 1) as f64);
        let i = place.floor() as usize;
        let near = self.heights.get(i).copied().flatten();
        let far = self.heights.get(i + 1).copied().flatten();
        match (near, far) {
            (Some(a), Some(b)) => a + (place - i as f64) * (b - a),
            (one, other) => one.or(other).unwrap_or(0.0),
        }
    }

    /// Mean rise between the centre and where the profile turns, without the rounded ends.
    fn flank(&self, samples: &[Sample]) -> f64 {
        let rings: Vec<(f64, f64)> = self
            .heights
            .iter()
            .enumerate()
            .filter_map(|(i, h)| h.map(|h| ((i as f64 + 0.5) * self.width, h)))
            .collect();
        let Some(&(_, first)) = rings.first() else { return 0.0 };
        let rise = |h: f64| h - first;
        let Some(&(end, top)) = rings.iter().max_by(|a, b| rise(a.1).abs().total_cmp(&rise(b.1).abs())) else {
            return 0.0;
        };
        let at = |share: f64| rings.iter().find(|(_, h)| rise(*h) / rise(top) >= share).map_or(end, |r| r.0);
        let (from, to) = (at(FLANK[0]), at(FLANK[1]));
        let inside =
            samples.iter().map(|s| (distance(s, self.centre), s.height)).filter(|p| (from..=to).contains(&p.0));
        let line = LineFit::of(inside.map(|(rho, height)| (rho, height, 1.0)));
        if line.spread() > 1e-12 { line.slope() } else { 0.0 }
    }
}

fn distance(s: &Sample, centre: [f64; 2]) -> f64 {
    (s.place[0] - centre[0]).hypot(s.place[1] - centre[1])
}

#[cfg(test)]
#[allow(clippy::panic)]
mod tests {
    use super::*;

    fn disc(height: impl Fn(f64, f64) -> f64) -> Vec<Sample> {
        let on = |i: i32| f64::from(i) * 0.05;
        let square = (-20..=20).flat_map(|i| (-20..=20).map(move |j| [on(i), on(j)]));
        let h = 1e-5;
        let slope = |x: f64, y: f64| {
            let across = |a: f64, b: f64| (a - b) / (2.0 * h);
            [across(height(x + h, y), height(x - h, y)), across(height(x, y + h), height(x, y - h))]
        };
        square
            .filter(|[x, y]| x.hypot(*y) < 1.0)
            .map(|[x, y]| Sample { place: [x, y], height: height(x, y), slope: slope(x, y) })
            .collect()
    }

    fn of(height: impl Fn(f64, f64) -> f64) -> Shape {
        shape(&disc(height), [0.0, 0.0], 1.0).unwrap_or_else(|| panic!("enough samples"))
    }

    #[test]
    fn a_cone_off_the_axis_has_its_angle_and_its_centre() {
        for (sign, form) in [(1.0, Form::Funnel), (-1.0, Form::Mound)] {
            let found = of(|x, y| sign * 0.5 * (x - 0.2).hypot(y + 0.1));
            assert_eq!(found.form, form);
            assert!((found.flank - sign * 0.5).abs() < 0.02, "{found:?}");
            assert!((found.steepness - 0.5).abs() < 1e-3);
            let centre = found.centre.unwrap_or_else(|| panic!("a centre"));
            assert!((centre[0] - 0.2).hypot(centre[1] + 0.1) < 0.02, "{centre:?}");
            assert!(found.asymmetry > 0.05 && found.irregularity < 0.01, "{found:?}");
        }
    }

    #[test]
    fn planes_are_flat_or_tilted() {
        assert_eq!(of(|x, _| 0.01 * x).form, Form::Flat);
        let tilted = of(|x, y| 0.3 * x - 0.1 * y);
        assert_eq!(tilted.form, Form::Tilted);
        assert!((tilted.tilt[0] - 0.3).abs() < 1e-6 && (tilted.tilt[1] + 0.1).abs() < 1e-6);
    }

    #[test]
    fn waves_are_irregular() {
        assert_eq!(of(|x, y| 0.1 * (9.0 * x).sin() * (8.0 * y).cos()).form, Form::Irregular);
    }

    #[test]
    fn few_samples_have_no_shape() {
        assert_eq!(shape(&disc(|_, _| 0.0)[..5], [0.0, 0.0], 1.0), None);
    }
}
