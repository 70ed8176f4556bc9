//! Returns gathered into cells: the wall taken away, each cell's surface told from dust by its median.

use super::grid::Grid;
use super::returns::{Return, Returns};

/// Returns within so many standard deviations of the wall belong to the wall.
const WALL_SIGMAS: f64 = 4.0;
/// Returns farther than so many robust standard deviations from their cell's median are clutter.
const CLUTTER_SIGMAS: f64 = 4.0;
/// Returns of which the medians are taken; more add time, not certainty.
const SURVEYED: usize = 80_000;
/// Fewest surveyed returns that make a median.
const FEWEST: usize = 3;

/// The cylinder that bounds the surface, and how well it is known.
#[derive(Debug, Clone, Copy)]
pub struct Bound {
    /// Radius of the cylinder.
    pub radius: f64,
    /// Variance of the horizontal distance to the wall: constant part, and part for each square metre of depth².
    pub variance: [f64; 2],
    /// z above which nothing is looked at.
    pub top: f64,
}

/// Where a return lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// Over this cell.
    Over(usize),
    /// On the cylinder's wall.
    Wall,
    /// Outside the silo.
    Outside,
}

impl Bound {
    /// Tells a return on the wall from one inside; |Δr| ≤ k σ is tested as |r² − R²| ≤ k (2 |p·ray| σ_d + 2 R σ_R).
    #[inline]
    pub fn place(&self, r: &Return, grid: &Grid) -> Place {
        let [x, y, z] = r.point;
        let lateral = (self.variance[0] + self.variance[1] * r.depth * r.depth).sqrt();
        let along = (x * r.ray[0] + y * r.ray[1]).abs() * r.sigma + self.radius * lateral;
        let margin = 2.0 * WALL_SIGMAS * along;
        let excess = x * x + y * y - self.radius * self.radius;
        if excess > margin || z < self.top {
            Place::Outside
        } else if excess > -margin {
            Place::Wall
        } else {
            grid.index(x, y).map_or(Place::Outside, Place::Over)
        }
    }
}

/// What the returns over one cell say.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Cell {
    /// Returns that agree with the cell's median.
    pub count: f64,
    /// Their mean point in the silo frame.
    pub mean: [f64; 3],
    /// Their mean distance from the axis.
    pub radius: f64,
    /// Their mean depth.
    pub depth: f64,
    /// Variance of their heights, and of their places along x and y.
    pub spread: [f64; 3],
    /// Variance of one return's height by the sensor's noise.
    pub noise: f64,
    /// Returns above what agrees.
    pub above: f64,
    /// Returns below what agrees.
    pub below: f64,
}

/// Counts of the whole frame.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Tally {
    /// Returns inside the profile's range.
    pub returns: f64,
    /// Returns on the cylinder's wall.
    pub wall: f64,
    /// Returns outside the silo.
    pub outside: f64,
    /// Returns over the surface that float above it.
    pub above: f64,
    /// Those of them whose predecessor in the frame also floats, at a like depth: a thing, not dust.
    pub coherent: f64,
}

/// Heights that agree with a cell's median.
#[derive(Debug, Clone, Copy)]
struct Window {
    low: f64,
    high: f64,
}

/// Nothing agrees with it.
const CLOSED: Window = Window { low: f64::INFINITY, high: f64::NEG_INFINITY };

/// Gathers a frame into cells.
pub fn gather(returns: &Returns<'_>, bound: &Bound, grid: &Grid) -> (Vec<Cell>, Tally) {
    let windows = survey(returns, bound, grid);
    let mut cells = vec![Cell::default(); grid.len()];
    let mut tally = Tally::default();
    let mut floating = f64::NEG_INFINITY;
    returns.visit(1, |r| {
        tally.returns += 1.0;
        match bound.place(&r, grid) {
            Place::Wall => tally.wall += 1.0,
            Place::Outside => tally.outside += 1.0,
            Place::Over(index) => {
                let (Some(cell), Some(window)) = (cells.get_mut(index), windows.get(index)) else { return };
                if r.point[2] < window.low {
                    cell.above += 1.0;
                    tally.above += 1.0;
                    tally.coherent += f64::from(u8::from((r.depth - floating).abs() < 0.02 * r.depth + 4.0 * r.sigma));
                    floating = r.depth;
                } else if r.point[2] > window.high {
                    cell.below += 1.0;
                } else {
                    cell.add(&r);
                }
            }
        }
    });
    cells.iter_mut().for_each(Cell::finish);
    (cells, tally)
}

impl Cell {
    /// Whether anything agrees in it.
    pub fn seen(&self) -> bool {
        self.count > 0.0
    }

    /// Adds to the sums that `finish` turns into means.
    #[inline]
    fn add(&mut self, r: &Return) {
        self.count += 1.0;
        for i in 0..3 {
            self.mean[i] += r.point[i];
            self.spread[i] += r.point[i] * r.point[i];
        }
        self.radius += (r.point[0] * r.point[0] + r.point[1] * r.point[1]).sqrt();
        self.depth += r.depth;
        let along = r.sigma * r.ray[2];
        self.noise += along * along;
    }

    fn finish(&mut self) {
        if self.count > 0.0 {
            let n = self.count;
            self.mean = self.mean.map(|sum| sum / n);
            for (spread, mean) in self.spread.iter_mut().zip(self.mean) {
                *spread = (*spread / n - mean * mean).max(0.0);
            }
            self.radius /= n;
            self.depth /= n;
            self.noise /= n;
        }
    }
}

/// The window of each cell, from every so many returns.
fn survey(returns: &Returns<'_>, bound: &Bound, grid: &Grid) -> Vec<Window> {
    let stride = (returns.len() as f64 / SURVEYED as f64).sqrt().floor().max(1.0) as usize;
    let mut found: Vec<(u32, f32, f32)> = Vec::with_capacity(returns.len() / (stride * stride) + 1);
    returns.visit(stride, |r| {
        if let Place::Over(cell) = bound.place(&r, grid) {
            found.push((cell as u32, r.point[2] as f32, (r.sigma * r.ray[2]) as f32));
        }
    });
    let starts = starts(&found, grid.len());
    let mut heights = vec![0f32; found.len()];
    let mut noise = vec![0f64; grid.len()];
    let mut next = starts.clone();
    for &(cell, z, sigma) in &found {
        let cell = cell as usize;
        if let (Some(place), Some(sum)) = (next.get_mut(cell), noise.get_mut(cell)) {
            if let Some(slot) = heights.get_mut(*place) {
                *slot = z;
            }
            *place += 1;
            *sum += f64::from(sigma);
        }
    }
    let ends = starts.iter().skip(1);
    let cells = starts.iter().zip(ends).zip(&noise);
    cells.map(|((&from, &to), &sum)| heights.get_mut(from..to).map_or(CLOSED, |z| window(z, sum))).collect()
}

/// First place of each cell in the sorted heights, and the end.
fn starts(found: &[(u32, f32, f32)], cells: usize) -> Vec<usize> {
    let mut starts = vec![0usize; cells + 1];
    for &(cell, ..) in found {
        if let Some(count) = starts.get_mut(cell as usize + 1) {
            *count += 1;
        }
    }
    let mut sum = 0;
    for start in &mut starts {
        sum += *start;
        *start = sum;
    }
    starts
}

/// Median ± k robust standard deviations, at least those of the sensor's noise.
fn window(heights: &mut [f32], sigmas: f64) -> Window {
    if heights.len() < FEWEST {
        return CLOSED;
    }
    let noise = sigmas / heights.len() as f64;
    let median = median(heights);
    heights.iter_mut().for_each(|z| *z = (*z - median).abs());
    let scatter = 1.4826 * f64::from(self::median(heights));
    let half = CLUTTER_SIGMAS * scatter.max(noise) + 1e-4;
    Window { low: f64::from(median) - half, high: f64::from(median) + half }
}

/// Upper median; the slice must not be empty.
fn median(values: &mut [f32]) -> f32 {
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f32::total_cmp).1
}
