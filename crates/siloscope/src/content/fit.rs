//! The surface through the cells: trend, then the detail that the trend is too smooth for.

use super::basis::{Basis, Roughness, Row, meeting_point};
use super::cells::Cell;
use super::detail;
use super::grid::Grid;
use super::roughness::most_probable;
use super::trend::{Observation, Sums, Trend, variance};
use crate::stats::robust::{MAD_TO_STD, upper_median};

/// A residual beyond so many robust standard deviations counts less, the more so the farther it is.
const HUBER: f64 = 2.5;
/// Rounds of reweighting.
const ROUNDS: usize = 2;
/// Roughness of the first, loose fit.
const LOOSE: Roughness = Roughness { bend: 1.0, rest: 0.1, range: 0 };
/// Roughness under which two centres are compared, and how much more probable the cells must be about the new one.
const TRIED: Roughness = Roughness { bend: 0.5, rest: 0.012, range: 0 };
const GAIN: f64 = 3.0;
/// A centre nearer to the axis than this, in radii, is the axis.
const OFF_AXIS: f64 = 0.03;
/// Smallest standard deviation of a cell's height, metres: what rounding and a cell's own curvature leave.
const SMALLEST: f64 = 5e-4;
/// What is continued errs by so much more than the prior says, as its roughness was chosen from the cells that it
/// explains; measured over lumpy feed.
pub const WIDER: f64 = 1.7;
/// Of more cells than these a sketch takes every other one.
const PLENTY: usize = 200;
/// Fewest cells that make a surface.
const FEWEST: usize = 3;

/// The surface of the content in the silo frame: z as a function of x and y.
#[derive(Debug, Clone)]
pub struct Surface {
    /// The cells.
    pub grid: Grid,
    /// The trend's functions.
    pub basis: Basis,
    /// The trend, in units of the grid's reach.
    pub trend: Trend,
    /// z of the trend's zero.
    pub datum: f64,
    /// What the cells add to the trend, metres down; 0 for each where the trend explains them.
    pub detail: Vec<f64>,
    /// Standard deviation of the detail, metres.
    pub roughness: f64,
    /// Cells over which a deviation from the trend keeps its sign, as an area in cells.
    pub patch: f64,
    /// Share of each cell's deviation that is the surface's and not the sensor's noise.
    pub kept: Vec<f64>,
    /// The observations that the trend was made of, with their cells.
    pub used: Vec<(usize, Observation)>,
    /// Slopes dz/dx and dz/dy of the trend there; none for a sketch.
    pub slopes: Vec<[f64; 2]>,
}

impl Surface {
    /// The basis at a place.
    pub fn row(&self, x: f64, y: f64) -> Row {
        self.basis.row(unit(&self.grid, [x, y, 0.0]))
    }

    /// z of the surface and its slopes at a place, by the trend alone.
    pub fn trend_at(&self, x: f64, y: f64) -> [f64; 3] {
        let [z, zx, zy] = self.trend.jet(&self.basis, unit(&self.grid, [x, y, 0.0]));
        [self.datum + z * self.grid.reach, zx, zy]
    }

    /// Heights of the trend at the cells' mean points, in its units about the mean of those cells.
    fn heights(&self, taken: &[usize], cells: &[Cell]) -> Vec<f64> {
        let mean = taken.iter().map(|&i| cells[i].mean[2]).sum::<f64>() / taken.len().max(1) as f64;
        let at = |&i: &usize| {
            let z = self.basis.height(unit(&self.grid, cells[i].mean), self.trend.coefficients.as_slice());
            z + (self.datum - mean) / self.grid.reach
        };
        taken.iter().map(at).collect()
    }

    /// z of the surface at a place.
    pub fn height(&self, x: f64, y: f64) -> f64 {
        let trend = self.basis.height(unit(&self.grid, [x, y, 0.0]), self.trend.coefficients.as_slice());
        self.datum + trend * self.grid.reach + detail::between(&self.grid, &self.detail, x, y)
    }

    /// Standard deviation of the height at each cell's middle: the trend's, and the detail's where it is not seen.
    pub fn deviations(&self, cells: &[Cell]) -> Vec<f64> {
        let covariance = self.trend.covariance();
        let deviation = |i: usize| {
            let [x, y] = self.grid.middle(i);
            let wider = if cells[i].seen() { 1.0 } else { WIDER * WIDER };
            let trend = wider * variance(&covariance, &self.row(x, y)) * self.grid.reach.powi(2);
            let kept = self.kept(i);
            let detail = if kept > 0.0 { kept * cells[i].variance } else { self.roughness.powi(2) };
            ((1.0 - kept).powi(2) * trend + detail).sqrt()
        };
        (0..self.grid.count()).map(deviation).collect()
    }

    /// Share of a cell's deviation from the trend that is taken for the surface's own.
    pub fn kept(&self, cell: usize) -> f64 {
        self.kept.get(cell).copied().unwrap_or(0.0)
    }
}

/// A place in the trend's units.
pub fn unit(grid: &Grid, [x, y, _]: [f64; 3]) -> [f64; 2] {
    [(x - grid.centre[0]) / grid.reach, (y - grid.centre[1]) / grid.reach]
}

/// A first surface: a loose fit, to tell what lies on it.
pub fn sketch(grid: &Grid, cells: &[Cell], take: &[bool]) -> Option<Surface> {
    let some: Vec<bool> = (0..take.len()).map(|i| take[i] && (i + i / grid.side).is_multiple_of(2)).collect();
    let enough = take.iter().filter(|&&t| t).count() > PLENTY;
    let mut work = Work::new(grid, cells, if enough { &some } else { take })?;
    let trend = work.robust(LOOSE)?;
    Some(work.finish(trend, 1.0, Vec::new()))
}

/// Fits the surface to the cells that `take` names, given a first one; None where they are too few.
pub fn fit(sketch: &Surface, cells: &[Cell], take: &[bool]) -> Option<Surface> {
    let mut work = Work::new(&sketch.grid, cells, take)?;
    work.reweight(&sketch.heights(&work.cells, cells));
    let sums = work.centre(cells, sketch);
    let (roughness, trend) = most_probable(&sums, &work.basis)?;
    let heights = work.heights(&trend);
    work.correct_curvature(&heights);
    let slopes = work.slopes(&heights);
    let patch = work.patch(&trend);
    work.inflate_variance(patch);
    let trend = Sums::new(work.basis.functions(), &work.observations).solve(&work.basis, roughness)?;
    Some(work.finish(trend, patch, slopes))
}

/// The observations on their way to a surface. Heights in units of the grid's reach.
struct Work<'a> {
    grid: &'a Grid,
    basis: Basis,
    datum: f64,
    cells: Vec<usize>,
    observations: Vec<Observation>,
    /// Variance of each cell's height by the sensor's noise alone.
    noise: Vec<f64>,
    /// Variance that the trend does not explain.
    rough: f64,
}

impl<'a> Work<'a> {
    fn new(grid: &'a Grid, cells: &[Cell], take: &[bool]) -> Option<Self> {
        let basis = Basis::new([0.0, 0.0]);
        let taken: Vec<usize> = (0..cells.len()).filter(|&i| take[i] && cells[i].seen()).collect();
        if taken.len() < FEWEST {
            return None;
        }
        let datum = taken.iter().map(|&i| cells[i].mean[2]).sum::<f64>() / taken.len() as f64;
        let noise = |c: &Cell| (c.variance + SMALLEST * SMALLEST) / (grid.reach * grid.reach);
        let observe = |&i: &usize| {
            let value = (cells[i].mean[2] - datum) / grid.reach;
            Observation { row: basis.row(unit(grid, cells[i].mean)), value, variance: noise(&cells[i]) }
        };
        let observations: Vec<_> = taken.iter().map(observe).collect();
        let noise = taken.iter().map(|&i| noise(&cells[i])).collect();
        Some(Self { grid, basis, datum, cells: taken, observations, noise, rough: 0.0 })
    }

    fn fitted(&self, trend: &Trend) -> Vec<f64> {
        self.observations.iter().map(|o| trend.height(&o.row)).collect()
    }

    fn residuals(&self, fitted: &[f64]) -> Vec<f64> {
        self.observations.iter().zip(fitted).map(|(o, z)| o.value - z).collect()
    }

    /// Reweighted least squares: cells off the surface lose their say.
    fn robust(&mut self, roughness: Roughness) -> Option<Trend> {
        let mut trend = Sums::new(self.basis.functions(), &self.observations).solve(&self.basis, roughness)?;
        for _ in 1..ROUNDS {
            self.reweight(&self.fitted(&trend));
            trend = Sums::new(self.basis.functions(), &self.observations).solve(&self.basis, roughness)?;
        }
        Some(trend)
    }

    /// Variances from the residuals: noise, what the trend leaves, and more for cells that stand out.
    fn reweight(&mut self, fitted: &[f64]) {
        let residuals = self.residuals(fitted);
        let scatter = scatter(&residuals).powi(2);
        let explained = self.noise.iter().sum::<f64>() / self.noise.len() as f64;
        self.rough = (scatter - explained).max(0.0);
        for ((o, residual), noise) in self.observations.iter_mut().zip(residuals).zip(&self.noise) {
            let plain = noise + self.rough;
            let excess = residual.abs() / (HUBER * plain.sqrt());
            o.variance = plain * excess.max(1.0).powi(2);
        }
    }

    /// Puts the profile's centre where the slopes meet, if the cells are then more probable than about the axis.
    fn centre(&mut self, cells: &[Cell], sketch: &Surface) -> Sums {
        let sums = |basis: &Basis, observations: &[Observation]| Sums::new(basis.functions(), observations);
        let about_axis = sums(&self.basis, &self.observations);
        let place = |i: &usize| unit(self.grid, cells[*i].mean);
        let few = self.cells.iter().step_by(self.cells.len() / PLENTY + 1).map(place);
        let slopes = few.map(|at| (at, sketch.trend.slopes(&sketch.basis, at)));
        let off_axis = |c: &[f64; 2]| c[0].hypot(c[1]) > OFF_AXIS;
        let Some(centre) = meeting_point(slopes).filter(off_axis) else { return about_axis };
        let basis = Basis::new(centre);
        let moved: Vec<Observation> = (self.cells.iter().zip(&self.observations))
            .map(|(i, o)| Observation { row: basis.row(place(i)), ..*o })
            .collect();
        let about_centre = sums(&basis, &moved);
        let evidence = |sums: &Sums, basis: &Basis| sums.solve(basis, TRIED).map_or(f64::NEG_INFINITY, |t| t.evidence);
        if evidence(&about_centre, &basis) <= evidence(&about_axis, &self.basis) + GAIN {
            return about_axis;
        }
        (self.basis, self.observations) = (basis, moved);
        about_centre
    }

    /// Takes from each cell's mean height what the surface's own bend over the cell adds to it: `cell² ∇²z / 24`.
    fn correct_curvature(&mut self, heights: &[f64]) {
        let grid = self.grid;
        for (o, &i) in self.observations.iter_mut().zip(&self.cells) {
            let (sum, beside) = grid.beside(i).fold((0.0, 0.0), |(sum, n), j| (sum + heights[j], n + 1.0));
            if beside == 4.0 {
                o.value -= (sum - 4.0 * heights[i]) / 24.0;
            }
        }
    }

    /// Heights of a trend at the middles of all cells.
    fn heights(&self, trend: &Trend) -> Vec<f64> {
        let place = |i: usize| self.grid.middle(i);
        let height = |[x, y]: [f64; 2]| self.basis.height(unit(self.grid, [x, y, 0.0]), trend.coefficients.as_slice());
        (0..self.grid.count()).map(place).map(height).collect()
    }

    /// Slopes dz/dx and dz/dy at the used cells, from the heights of their neighbours.
    fn slopes(&self, heights: &[f64]) -> Vec<[f64; 2]> {
        let (side, step) = (self.grid.side, 2.0 / self.grid.side as f64);
        let rise = |i: usize, below: Option<usize>, above: Option<usize>| {
            let (from, to) = (below.unwrap_or(i), above.unwrap_or(i));
            let steps = f64::from(u8::from(below.is_some()) + u8::from(above.is_some()));
            (heights[to] - heights[from]) / (steps.max(1.0) * step)
        };
        let slope = |&i: &usize| {
            let (column, row) = (i % side, i / side);
            let along_x = rise(i, (column > 0).then(|| i - 1), (column + 1 < side).then_some(i + 1));
            let along_y = rise(i, (row > 0).then(|| i - side), (row + 1 < side).then_some(i + side));
            [along_x, along_y]
        };
        self.cells.iter().map(slope).collect()
    }

    /// Deviations that keep together over a patch of cells count once, not once a cell.
    fn inflate_variance(&mut self, patch: f64) {
        for (o, noise) in self.observations.iter_mut().zip(&self.noise) {
            o.variance *= (noise + patch * self.rough) / (noise + self.rough);
        }
    }

    /// Area in cells over which residuals keep together, from the correlation of neighbours.
    fn patch(&self, trend: &Trend) -> f64 {
        let residuals = self.residuals(&self.fitted(trend));
        let limit = HUBER * scatter(&residuals);
        let mut at = vec![f64::NAN; self.grid.count()];
        for (&i, r) in self.cells.iter().zip(&residuals) {
            at[i] = r.clamp(-limit, limit);
        }
        let (mut product, mut square, mut pairs) = (0.0, 0.0, 0.0);
        for &i in &self.cells {
            for j in self.grid.beside(i).filter(|&j| j > i && at[j].is_finite()) {
                product += at[i] * at[j];
                square += 0.5 * (at[i] * at[i] + at[j] * at[j]);
                pairs += 1.0;
            }
        }
        if pairs < 8.0 || square <= 0.0 {
            return 1.0;
        }
        let correlation = (product / square).clamp(0.0, 0.9);
        ((1.0 + correlation) / (1.0 - correlation)).powi(2)
    }

    fn finish(self, trend: Trend, patch: f64, slopes: Vec<[f64; 2]>) -> Surface {
        let residuals = self.residuals(&self.fitted(&trend));
        let reach = self.grid.reach;
        let mut known = vec![None; self.grid.count()];
        let mut kept = vec![0.0; self.grid.count()];
        for ((&i, residual), noise) in self.cells.iter().zip(&residuals).zip(&self.noise) {
            kept[i] = self.rough / (self.rough + noise);
            known[i] = Some(kept[i] * residual * reach);
        }
        let detail = if self.rough > 0.0 { detail::fill(self.grid, &known) } else { vec![0.0; self.grid.count()] };
        Surface {
            grid: *self.grid,
            basis: self.basis,
            trend,
            datum: self.datum,
            detail,
            roughness: self.rough.sqrt() * reach,
            patch,
            kept,
            slopes,
            used: self.cells.into_iter().zip(self.observations).collect(),
        }
    }
}

/// Robust standard deviation about zero.
fn scatter(residuals: &[f64]) -> f64 {
    let mut sizes: Vec<f64> = residuals.iter().map(|r| r.abs()).collect();
    MAD_TO_STD * upper_median(&mut sizes).unwrap_or(0.0)
}
