//! Which cells show the content, which the bare cone, and which something else.

use super::cells::Cell;
use super::fit::{Surface, fit, sketch};
use super::grid::Grid;
use super::jacobian::{CalibrationJacobian, Covariance, deviation};
use super::under::Under;
use super::volume::Kind;

/// A cell shows content where its mean lies so many standard deviations above the floor.
const SIGMAS: f64 = 4.0;
/// A cell is clear of the rim where the content under its middle is thicker than this many cells times its rise.
const CLEAR: f64 = 0.75;
/// Content thicker than this many cells is clear of the rim however it slopes.
const THICK: f64 = 4.0;
/// Steepest climb between neighbouring cells of one surface: tan 65°; feed at rest never lies so steep.
const STEEPEST: f64 = 2.1;

/// The cells' kinds and the surface through those that show content.
#[derive(Debug, Clone)]
pub struct Classified {
    /// One for each cell.
    pub kinds: Vec<Kind>,
    /// None where hardly any cell shows content.
    pub surface: Option<Surface>,
    /// Things above the surface, by size.
    pub things: Vec<Thing>,
    /// Steep holes: parts of the surface that lie far below the rest, by size.
    pub holes: Vec<Thing>,
    /// Share of the seen cells that lie surely below the floor.
    pub sunken: f64,
}

/// Neighbouring cells that steep steps part from the surface.
#[derive(Debug, Clone, PartialEq)]
pub struct Thing {
    /// Its cells.
    pub cells: Vec<usize>,
    /// Mean height above the surface's trend, metres; negative for a hole.
    pub above: f64,
    /// Whether it reaches the silo's wall.
    pub at_wall: bool,
}

/// What the cells are compared with.
#[derive(Debug, Clone, Copy)]
pub struct Floor<'a> {
    /// The silo and its floor.
    pub under: Under<'a>,
    /// The pose's derivatives.
    pub jacobian: &'a CalibrationJacobian,
    /// How well pose, geometry and depth are known.
    pub covariance: &'a Covariance,
    /// How uneven the wall is, metres (standard deviation).
    pub wall_std: f64,
}

impl Floor<'_> {
    /// How far a cell's mean lies above the floor, in standard deviations.
    fn sigmas_above(&self, cell: &Cell, grid: &Grid) -> f64 {
        let [x, y, z] = cell.mean;
        let thickness = self.under.over_cell(cell.mean, grid.cell()) - z;
        let known = deviation(&self.under.thickness(cell.mean, self.jacobian), self.covariance);
        let noise = cell.variance + self.wall_std * self.wall_std + self.under.std(x, y).powi(2);
        thickness / (known * known + noise).sqrt()
    }

    /// The same of every cell, 0 for those that were not seen.
    fn all_above(&self, cells: &[Cell], grid: &Grid) -> Vec<f64> {
        cells.iter().map(|c| if c.seen() { self.sigmas_above(c, grid) } else { 0.0 }).collect()
    }

    /// Distances from the axis of the nearest and the farthest cell that shows the bare floor.
    pub fn bare(&self, cells: &[Cell], grid: &Grid) -> Option<[f64; 2]> {
        let above = self.all_above(cells, grid);
        let bare = (0..cells.len()).filter(|&i| cells[i].seen() && above[i] <= SIGMAS);
        extent(grid, bare)
    }
}

/// Distances from the axis of the nearest and the farthest of some cells.
pub fn extent(grid: &Grid, cells: impl Iterator<Item = usize>) -> Option<[f64; 2]> {
    cells.map(|i| grid.middle(i)).map(|[x, y]| x.hypot(y)).fold(None, |found, r| match found {
        None => Some([r, r]),
        Some([near, far]) => Some([f64::min(near, r), f64::max(far, r)]),
    })
}

/// Sorts the cells and fits the surface.
pub fn classify(grid: &Grid, cells: &[Cell], floor: &Floor<'_>) -> Classified {
    let above = floor.all_above(cells, grid);
    let covered: Vec<bool> = above.iter().map(|&sigmas| sigmas > SIGMAS).collect();
    let main = main_part(grid, cells, &covered);
    let (mut things, mut holes) = (Vec::new(), Vec::new());
    let mut surface = None;
    if let Some(sketch) = sketch(grid, cells, &main) {
        (things, holes) = parted(grid, cells, &covered, &main, &sketch, floor.under.vessel.radius);
        let mut take = covered.clone();
        things.iter().flat_map(|t: &Thing| &t.cells).for_each(|&i| take[i] = false);
        for (take, cell) in take.iter_mut().zip(cells) {
            *take = *take && clear_of_rim(&sketch, &floor.under, cell);
        }
        surface = fit(&sketch, cells, &take).or_else(|| fit(&sketch, cells, &main));
    }
    let kinds = kinds(grid, cells, &covered, &things);
    let seen = cells.iter().filter(|c| c.seen()).count().max(1) as f64;
    let sunken = above.iter().filter(|&&sigmas| sigmas < -SIGMAS).count() as f64 / seen;
    Classified { kinds, surface, things, holes, sunken }
}

/// Whether the content's rim stays out of a cell.
fn clear_of_rim(surface: &Surface, under: &Under<'_>, cell: &Cell) -> bool {
    let [x, y, seen] = cell.mean;
    let floor = under.z([x, y], x.hypot(y));
    if floor - seen > THICK * surface.grid.cell() {
        return true;
    }
    let ([z, zx, zy], [fx, fy]) = (surface.trend_at(x, y), under.slopes(x, y));
    floor - z > CLEAR * surface.grid.cell() * (fx - zx).hypot(fy - zy)
}

fn kinds(grid: &Grid, cells: &[Cell], covered: &[bool], things: &[Thing]) -> Vec<Kind> {
    let mut kinds: Vec<Kind> = cells
        .iter()
        .enumerate()
        .map(|(i, cell)| match (cell.seen(), covered[i]) {
            (false, _) => Kind::Unseen,
            (true, true) => Kind::Feed,
            (true, false) if grid.around(i).any(|j| covered[j]) => Kind::Rim,
            (true, false) => Kind::Bare,
        })
        .collect();
    things.iter().flat_map(|t| &t.cells).for_each(|&i| kinds[i] = Kind::Clutter);
    kinds
}

/// Labels of the parts into which steep steps divide the covered cells; 0 for cells that are not covered.
fn parts(grid: &Grid, cells: &[Cell], covered: &[bool]) -> (Vec<usize>, Vec<usize>) {
    let mut labels = vec![0; grid.count()];
    let mut sizes = vec![0];
    let mut stack = Vec::new();
    for seed in 0..grid.count() {
        if !covered[seed] || labels[seed] != 0 {
            continue;
        }
        let label = sizes.len();
        sizes.push(0);
        labels[seed] = label;
        stack.push(seed);
        while let Some(i) = stack.pop() {
            sizes[label] += 1;
            for j in grid.around(i).filter(|&j| covered[j]) {
                if labels[j] == 0 && joined(&cells[i], &cells[j]) {
                    labels[j] = label;
                    stack.push(j);
                }
            }
        }
    }
    (labels, sizes)
}

/// Whether one could walk from one cell to the other.
fn joined(a: &Cell, b: &Cell) -> bool {
    let [dx, dy, dz] = [0, 1, 2].map(|k| a.mean[k] - b.mean[k]);
    let noise = (a.variance + b.variance).sqrt();
    dz.abs() <= STEEPEST * dx.hypot(dy) + 4.0 * noise
}

/// The largest part.
fn main_part(grid: &Grid, cells: &[Cell], covered: &[bool]) -> Vec<bool> {
    let (labels, sizes) = parts(grid, cells, covered);
    let largest = (1..sizes.len()).max_by_key(|&label| sizes[label]);
    labels.iter().map(|&label| Some(label) == largest).collect()
}

/// Parts that float above the surface, and parts that lie in holes.
fn parted(
    grid: &Grid,
    cells: &[Cell],
    covered: &[bool],
    main: &[bool],
    surface: &Surface,
    radius: f64,
) -> (Vec<Thing>, Vec<Thing>) {
    let (labels, sizes) = parts(grid, cells, covered);
    let mut found: Vec<Thing> = vec![Thing { cells: Vec::new(), above: 0.0, at_wall: false }; sizes.len()];
    for i in (0..grid.count()).filter(|&i| covered[i] && !main[i]) {
        let [x, y, z] = cells[i].mean;
        let thing = &mut found[labels[i]];
        thing.cells.push(i);
        thing.above += surface.trend_at(x, y)[0] - z;
        thing.at_wall |= radius - x.hypot(y) < 2.0 * grid.cell();
    }
    found.iter_mut().for_each(|t| t.above /= t.cells.len().max(1) as f64);
    let least = (3.0 * surface.roughness).max(STEEPEST * grid.cell());
    found.retain(|t| t.above.abs() > least);
    found.sort_by_key(|t| std::cmp::Reverse(t.cells.len()));
    found.into_iter().partition(|t| t.above > 0.0)
}
