//! Would the answer be another one without a part of the wall? Then that part may be something else that lies before it.
//!
//! Feed stuck to one side of the silo or to the lower half of the cone is evened out into the fit, and leaves residuals
//! that hardly differ from dents. Leaving such a part out tells it: by how much an answer that is right may change then
//! follows from how much less is seen.

use crate::geometry::parameters::{Information, OVALITY, PARAMETERS, Parameters};
use crate::geometry::surface::Part;
use crate::surface_fit::polish::TileEquation;
use crate::surface_fit::solver::{Fit, System, tukey};
use std::array::from_fn;
use std::sync::LazyLock;

/// Each part of the wall is cut into so many bands with as much of it each.
const BANDS: usize = 4;
/// And along so many planes through the silo's axis, into sectors.
const AXES: usize = 3;
const SECTORS: usize = 1 << AXES;
/// So many cells of cylinder and cone there are: as many as a word has bits.
const CELLS: usize = 2 * BANDS * SECTORS;
/// Of so many tiles one is asked for its information.
const SKETCH: usize = 4;
/// A change by more than so many of its standard deviations is none by chance, nor by the wall's form.
const SURE: f64 = 3.0;
/// Where what is left tells a parameter less surely than this, as a multiple of its variance, it tells nothing about it.
const WEAK: f64 = 25.0;
/// Least change by chance, as a share of a variance.
const LITTLE: f64 = 1e-3;
/// Fewest tiles of a part that is left out, and of what is left.
const FEWEST: usize = 24;
/// The parameters of the wall: pose, radius, cone.
const WALL: usize = 7;

/// Tiles added up: their information, their gradient, and how many they are.
#[derive(Clone)]
struct Cell {
    information: Information,
    gradient: Parameters,
    count: usize,
}

/// The largest change of the answer that leaving a part of the wall out makes, where that is more than its covariance
/// allows; without what it does allow.
///
/// `joint` is the system of all parameters and `model` its covariance; `covariance` is what has been made of that, and
/// `oval` tells whether the ovality is estimated.
pub fn change_without_a_part(
    fit: &Fit,
    joint: &System,
    (model, covariance): (&Information, &Information),
    (tiles, pulls): (&[TileEquation], &[f64]),
    oval: bool,
) -> Option<Parameters> {
    let cells = cells(tiles, pulls);
    let (all, seen) = (gradient(&cells, EVERYWHERE), count(&cells, EVERYWHERE));
    let mut left_open = Parameters::zeros(); // all else is at its best
    if !oval {
        left_open.fixed_rows_mut::<2>(OVALITY).copy_from(&all.fixed_rows::<2>(OVALITY));
    }
    let now = model * left_open;
    let change = |&part: &u64| {
        let without = count(&cells, part);
        if without < FEWEST || seen < without + FEWEST || pulls_as_noise_does(&cells, part) {
            return None;
        }
        let without = Cell::sum(&cells, part);
        let rest = System { information: joint.information - without.information, ..joint.clone() };
        let (spread, _) = rest.covariance(fit)?;
        let change = now - spread * (left_open - without.gradient);
        let excess = |k: usize| {
            let (chance, widened) = (spread[(k, k)] - model[(k, k)], covariance[(k, k)] / model[(k, k)]);
            let told = model[(k, k)] > 0.0 && chance < (WEAK - 1.0) * model[(k, k)];
            told.then(|| change[k] * change[k] / (chance.max(LITTLE * model[(k, k)]) * widened))
        };
        let free = (0..WALL).filter(|&k| model[(k, k)] > 0.0);
        let most = free.map(excess).try_fold(0.0, |most, excess| Some(f64::max(most, excess?)))?;
        (most > SURE * SURE).then_some((most, change))
    };
    let (most, change) = PARTS.iter().filter_map(change).max_by(|a, b| a.0.total_cmp(&b.0))?;
    Some(change * (1.0 - SURE * SURE / most).sqrt())
}

/// What may be left out, as the bits of its cells: the upper or lower bands of either part of the wall, and one side of all
/// of it, of its cone, and of the cone's upper and lower half.
static PARTS: LazyLock<Vec<u64>> = LazyLock::new(|| {
    let cells = |asked: &dyn Fn(usize, usize, usize) -> bool| {
        (0..CELLS)
            .filter(|i| asked(i / (BANDS * SECTORS), i / SECTORS % BANDS, i % SECTORS))
            .fold(0, |set, i| set | 1 << i)
    };
    let mut parts = Vec::new();
    for (part, cut) in (0..2).flat_map(|part| (1..BANDS).map(move |cut| (part, cut))) {
        parts.push(cells(&|p, band, _| p == part && band < cut));
        parts.push(cells(&|p, band, _| p == part && band >= cut));
    }
    let cone = cells(&|part, _, _| part == 1);
    let upper = cells(&|_, band, _| band < BANDS / 2);
    for (axis, side) in (0..AXES).flat_map(|axis| [(axis, 0), (axis, 1)]) {
        let side = cells(&|_, _, sector| sector >> axis & 1 == side);
        parts.extend([side, side & cone, side & cone & upper, side & cone & !upper]);
    }
    parts
});

/// All cells.
const EVERYWHERE: u64 = u64::MAX;

/// The tiles by part, band and sector.
fn cells(tiles: &[TileEquation], pulls: &[f64]) -> Vec<Cell> {
    let cuts = [Part::Cylinder, Part::Cone].map(|part| {
        let some = tiles.iter().step_by(SKETCH).map(|t| &t.equation).filter(|e| e.part == part);
        let mut z: Vec<f64> = some.map(|e| e.z).collect();
        z.sort_unstable_by(f64::total_cmp);
        from_fn::<_, { BANDS - 1 }, _>(|i| z.get((i + 1) * z.len() / BANDS).copied().unwrap_or(f64::INFINITY))
    });
    let mut cells = vec![Cell::empty(); CELLS];
    for (i, (TileEquation { equation: e, .. }, pull)) in tiles.iter().zip(pulls).enumerate() {
        let part = usize::from(e.part == Part::Cone);
        let band = cuts[part].iter().filter(|cut| e.z > **cut).count();
        let cell = &mut cells[(part * BANDS + band) * SECTORS + sector(e.across)];
        cell.gradient += e.jacobian * *pull;
        cell.count += 1;
        if i.is_multiple_of(SKETCH) {
            let weight = SKETCH as f64 * tukey(e.residual * e.residual / e.variance) / e.variance;
            cell.information.syger(weight, &e.jacobian, &e.jacobian, 1.0);
        }
    }
    cells
}

/// On which side of each of three axes, 60° apart, a point across the silo's axis lies: one bit each.
fn sector([x, y]: [f64; 2]) -> usize {
    let sides = [x, 0.5 * (x + ROOT_3 * y), 0.5 * (x - ROOT_3 * y)];
    sides.iter().enumerate().map(|(axis, side)| usize::from(*side > 0.0) << axis).sum()
}

const ROOT_3: f64 = 1.732_050_807_568_877_2;

/// The cells of a part.
fn of(cells: &[Cell], part: u64) -> impl Iterator<Item = &Cell> {
    cells.iter().enumerate().filter(move |(i, cell)| part >> i & 1 == 1 && cell.count > 0).map(|(_, cell)| cell)
}

fn count(cells: &[Cell], part: u64) -> usize {
    of(cells, part).map(|cell| cell.count).sum()
}

fn gradient(cells: &[Cell], part: u64) -> Parameters {
    of(cells, part).map(|cell| cell.gradient).sum()
}

/// Whether chance explains the gradient of a part: then the answer does not change without it.
fn pulls_as_noise_does(cells: &[Cell], part: u64) -> bool {
    let gradient = gradient(cells, part);
    let information = of(cells, part).fold(Parameters::zeros(), |sum, cell| sum + cell.information.diagonal());
    (0..PARAMETERS).all(|k| gradient[k].powi(2) <= SURE * SURE * information[k])
}

impl Cell {
    fn empty() -> Self {
        Self { information: Information::zeros(), gradient: Parameters::zeros(), count: 0 }
    }

    fn sum(cells: &[Self], part: u64) -> Self {
        let mut sum = Self::empty();
        for cell in of(cells, part) {
            sum.information += cell.information;
            sum.gradient += cell.gradient;
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::evaluator::SurfaceEvaluator;
    use crate::geometry::sensor::DepthBias;
    use crate::geometry::surface::{Cone, SiloSurface};
    use crate::surface_fit::solver::{Equation, Prior};
    use crate::{SiloPose, Vec3};

    const NOISE: f64 = 1e-3;
    const SHARE: f64 = 0.25;

    fn fit() -> Fit {
        let pose = SiloPose { r_x: 0.1, r_y: -0.05, t_x: 0.3, t_y: 0.2 };
        let cone = Some(Cone { slope: 0.8, apex: 5.0 });
        let surface = SiloSurface { pose, radius: Some(1.2), cone, ovality: [0.0; 2] };
        Fit { surface, bias: DepthBias::default(), inside: true, misfit: 0.0, weights: Vec::new() }
    }

    /// Equations of points all over the wall, with residuals of noise and `off`, at the answer they have by least squares.
    fn tiles(seed: f64, oval: bool, off: impl Fn(Part, Vec3) -> f64) -> Vec<TileEquation> {
        let (fit, surface) = (fit(), SurfaceEvaluator::new(fit().surface));
        let chance = |i: f64| (((i + seed) * 12.9898).sin() * 43_758.545_3).fract() * NOISE * 3.0_f64.sqrt();
        let of_point = |i: usize| {
            let z = 1.5 + 3.0 * (i as f64 / 3000.0);
            let part = if z < surface.bottom() { Part::Cylinder } else { Part::Cone };
            let radius = if part == Part::Cylinder { 1.2 } else { 0.8 * (5.0 - z) };
            let azimuth = 2.4 * i as f64;
            let p = Vec3::new(radius * azimuth.cos(), radius * azimuth.sin(), z);
            let pose = fit.surface.pose;
            let camera = pose.rotation().transpose() * (p - Vec3::new(pose.t_x, pose.t_y, 0.0));
            let at = surface.local(&camera);
            let along = at.gradient.dot(&surface.turn(&camera)) / camera.z;
            let jacobian = surface.derivative(&camera, &at) / along;
            let equation = Equation {
                residual: chance(i as f64) + off(part, p),
                jacobian,
                variance: NOISE * NOISE / SHARE, // far from what would lose weight
                cosine: 0.5,
                part,
                z,
                across: [p.x, p.y],
            };
            TileEquation {
                patch: i,
                equation,
                noise: NOISE * NOISE,
                expected: 64.0 * NOISE * NOISE,
                scatter: NOISE,
                count: 64.0,
                spread: 1.0,
            }
        };
        let mut tiles: Vec<TileEquation> = (0..3000).map(of_point).collect();
        for _ in 0..8 {
            let step = solved(&tiles, oval, |_| true).0;
            tiles.iter_mut().for_each(|t| t.equation.residual += t.equation.jacobian.dot(&step));
        }
        tiles
    }

    /// A step from the answer to that of some tiles alone, its system, and covariance.
    fn solved(
        tiles: &[TileEquation],
        oval: bool,
        asked: impl Fn(&Equation) -> bool,
    ) -> (Parameters, System, Information) {
        let bias = DepthBias::default();
        let prior = Prior { bias, bias_std: [0.0; 3], radius: None, gravity: None, ovality_std: 0.0 };
        let mut system = System::with_prior(&prior, &fit());
        for e in tiles.iter().map(|t| &t.equation).filter(|e| asked(e)) {
            system.add(e, tukey(e.residual * e.residual / e.variance));
        }
        let system = if oval { system.with_ovality(0.005) } else { system };
        let model = system.covariance(&fit()).map_or(Information::zeros(), |(model, _)| model);
        (-(model * system.gradient), system, model)
    }

    fn change(tiles: &[TileEquation], oval: bool) -> Option<Parameters> {
        let pulls: Vec<f64> = tiles.iter().map(TileEquation::pull).collect();
        let (_, system, model) = solved(tiles, true, |_| true);
        change_without_a_part(&fit(), &system, (&model, &(model * SHARE)), (tiles, &pulls), oval)
    }

    #[test]
    fn noise_changes_no_answer() {
        for seed in 0..20 {
            assert_eq!(change(&tiles(f64::from(seed) * 7.7, true, |_, _| 0.0), true), None, "{seed}");
        }
    }

    #[test]
    fn film_on_one_side_changes_the_answer_by_what_is_wrong_with_it() {
        let film = |part: Part, p: Vec3| if part == Part::Cone && p.x > 0.0 { -0.0015 } else { 0.0 };
        let tiles = tiles(1.0, true, film);
        let found = change(&tiles, true).unwrap_or_default();
        let model = solved(&tiles, true, |_| true).2;
        let off = |side: f64| {
            let rest = solved(&tiles, true, |e| e.part != Part::Cone || side * e.across[0] <= 0.0).0;
            (0..WALL)
                .map(|k| (found[k] - rest[k]).abs() / (0.2 * rest[k].abs() + 0.1 * model[(k, k)].sqrt()))
                .fold(0.0, f64::max)
        };
        assert!(off(1.0).min(off(-1.0)) < 1.0, "{} {} {found}", off(1.0), off(-1.0));
        assert!((0..WALL).any(|k| found[k].powi(2) > 0.05 * model[(k, k)]), "{found}");
    }

    #[test]
    fn an_ovality_that_is_left_out_of_the_answer_is_no_change() {
        let oval = |_: Part, p: Vec3| 0.0003 * (p.x * p.x - p.y * p.y) / (p.x * p.x + p.y * p.y);
        let tiles = tiles(2.0, false, oval);
        assert_eq!(change(&tiles, false), None);
        assert!(change(&tiles, true).is_some());
    }
}
