//! SiloPoints gathered into cells: the wall taken away, each cell's surface told from dust by its median.

use super::bound::{Bound, Side};
use super::grid::Grid;
use super::jacobian::CalibrationJacobian;
use super::silo_points::{ScanLine, SiloPoints};
use crate::geometry::sensor::NoiseLaw;
use crate::stats::robust::MAD_TO_STD;

/// SiloPoints farther than so many robust standard deviations from their cell's median are clutter.
const CLUTTER_SIGMAS: f32 = 4.0;
/// SiloPoints of which the medians are taken; more add time, not certainty.
const SURVEYED: f64 = 12_000.0;
/// Fewest surveyed returns that make a median.
const FEWEST: usize = 3;
/// Two floating returns in a row whose depths differ by less than this share show a thing, not dust.
const COHERENT: f32 = 0.02;

/// 2²³: a number of single precision that is added to it is rounded to whole numbers, which stand in its lowest bits.
/// Conversions would do the same, but not for four returns at a time.
const WHOLE: f32 = 8_388_608.0;

/// Cells and squared distances from the axis of one line's returns.
#[derive(Debug, Default)]
struct Places {
    cell: Vec<u32>,
    square: Vec<f32>,
}

impl Places {
    fn work_out(&mut self, line: &ScanLine, grid: &Grid) {
        self.cell.resize(line.len(), 0);
        self.square.resize(line.len(), 0.0);
        let scale = 1.0 / grid.cell() as f32;
        let [ox, oy] = grid.centre.map(|c| (grid.reach - c) as f32 * scale - 0.5);
        let (side, last) = (grid.side as f32, (grid.side - 1) as f32);
        let whole = |place: f32| (place.max(0.0).min(last) + WHOLE) - WHOLE;
        let out = self.cell.iter_mut().zip(&mut self.square);
        for ((cell, square), (&x, &y)) in out.zip(line.x.iter().zip(&line.y)) {
            let index = whole(y * scale + oy) * side + whole(x * scale + ox);
            *cell = (index + WHOLE).to_bits() & (WHOLE as u32 - 1);
            *square = x * x + y * y;
        }
    }
}

/// What the returns over one cell say.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Cell {
    /// SiloPoints that agree with the cell's median.
    pub count: f64,
    /// Their mean point in the silo frame.
    pub mean: [f64; 3],
    /// Variance of their mean height by the sensor's noise.
    pub variance: f64,
}

impl Cell {
    /// Whether anything agrees in it.
    pub fn seen(&self) -> bool {
        self.count > 0.0
    }

    fn finish(&mut self, noise: &NoiseLaw, jacobian: &CalibrationJacobian) {
        if self.count > 0.0 {
            self.mean = self.mean.map(|sum| sum / self.count);
            let depth = jacobian.depth(self.mean);
            self.variance = (noise.sigma(depth) / jacobian.gain(depth) * self.mean[2] / depth).powi(2) / self.count;
        }
    }
}

/// Counts of the whole frame.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Counts {
    /// Pixels or points with a measurement.
    pub returns: f64,
    /// SiloPoints on the cylinder's wall.
    pub wall: f64,
    /// SiloPoints outside the silo.
    pub outside: f64,
    /// SiloPoints over the surface that float above it.
    pub above: f64,
    /// Those of them whose predecessor in the frame also floats, at a like depth: a thing, not dust.
    pub coherent: f64,
}

/// Heights that agree with a cell's median.
#[derive(Debug, Clone, Copy)]
struct Window {
    low: f32,
    high: f32,
}

/// Nothing agrees with it.
const CLOSED: Window = Window { low: f32::INFINITY, high: f32::NEG_INFINITY };

/// Gathers a frame into cells.
pub fn gather(
    returns: &SiloPoints<'_>,
    bound: &Bound,
    grid: &Grid,
    noise: &NoiseLaw,
    jacobian: &CalibrationJacobian,
) -> (Vec<Cell>, Counts) {
    let mut sums = Gathering {
        bound,
        windows: survey(returns, bound, grid, noise),
        cells: vec![Cell::default(); grid.count()],
        tally: Counts::default(),
        floating: f32::INFINITY,
    };
    let mut places = Places::default();
    returns.visit(1, |line| {
        places.work_out(line, grid);
        sums.add(line, &places);
    });
    sums.cells.iter_mut().for_each(|cell| cell.finish(noise, jacobian));
    (sums.cells, sums.tally)
}

/// SiloPoints one after another over the same cell, not yet added to it: their sum of x, y, z and 1.
///
/// A run is some ten returns long, so single precision loses nothing.
struct Run {
    cell: u32,
    window: Window,
    sum: [f32; 4],
}

/// Sums on their way.
struct Gathering<'a> {
    bound: &'a Bound,
    windows: Vec<Window>,
    cells: Vec<Cell>,
    tally: Counts,
    floating: f32,
}

impl Gathering<'_> {
    fn add(&mut self, line: &ScanLine, places: &Places) {
        let (inside, mut wall, mut outside) = (self.bound.inside(line), 0, 0);
        let mut run = Run { cell: u32::MAX, window: CLOSED, sum: [0.0; 4] }; // a local one stays in registers
        let points = line.x.iter().zip(&line.y).zip(&line.z).zip(&line.depth);
        for ((((&x, &y), &z), &depth), (&cell, &square)) in points.zip(places.cell.iter().zip(&places.square)) {
            if depth <= 0.0 {
                continue;
            }
            if !self.bound.surely_inside(inside, square, z) {
                let side = self.bound.side([x, y, z], depth);
                wall += u32::from(side == Side::Wall);
                outside += u32::from(side == Side::Outside);
                if side != Side::Inside {
                    continue;
                }
            }
            if cell != run.cell {
                self.flush(&run);
                run = Run { cell, window: self.window(cell), sum: [0.0; 4] };
            }
            if run.window.holds(z) {
                run.sum.iter_mut().zip([x, y, z, 1.0]).for_each(|(sum, part)| *sum += part);
            } else if z < run.window.low && run.window.known() {
                self.floats(depth);
            }
        }
        self.flush(&run);
        self.tally.wall += f64::from(wall);
        self.tally.outside += f64::from(outside);
        self.tally.returns += f64::from(line.depth.iter().map(|&d| u32::from(d > 0.0)).sum::<u32>());
    }

    fn window(&self, cell: u32) -> Window {
        self.windows.get(cell as usize).copied().unwrap_or(CLOSED)
    }

    /// A return that floats above the surface.
    #[cold]
    fn floats(&mut self, depth: f32) {
        self.tally.above += 1.0;
        self.tally.coherent += f64::from(u8::from((depth - self.floating).abs() < COHERENT * depth));
        self.floating = depth;
    }

    fn flush(&mut self, run: &Run) {
        let [x, y, z, count] = run.sum.map(f64::from);
        if let Some(cell) = self.cells.get_mut(run.cell as usize) {
            cell.count += count;
            cell.mean = [cell.mean[0] + x, cell.mean[1] + y, cell.mean[2] + z];
        }
    }
}

/// A surveyed return: its cell, height and depth.
type Sample = (u32, f32, f32);

/// The window of each cell, from every so many returns.
fn survey(returns: &SiloPoints<'_>, bound: &Bound, grid: &Grid, noise: &NoiseLaw) -> Vec<Window> {
    let stride = (returns.len() as f64 / SURVEYED).sqrt().round().max(1.0) as usize;
    let mut samples: Vec<Sample> = Vec::with_capacity(returns.len() / (stride * stride) + 1);
    let mut places = Places::default();
    returns.visit(stride, |line| {
        places.work_out(line, grid);
        let inside = bound.inside(line);
        for i in (0..line.len()).filter(|&i| line.depth[i] > 0.0) {
            let (point, depth) = ([line.x[i], line.y[i], line.z[i]], line.depth[i]);
            if bound.surely_inside(inside, places.square[i], point[2]) || bound.side(point, depth) == Side::Inside {
                samples.push((places.cell[i], point[2], depth));
            }
        }
    });
    let samples = by_cell(&samples, grid.count());
    let mut windows = vec![CLOSED; grid.count()];
    let mut values = Vec::new();
    for group in samples.chunk_by(|a, b| a.0 == b.0) {
        if let Some(window) = group.first().and_then(|s| windows.get_mut(s.0 as usize)) {
            *window = self::window(group, noise, &mut values);
        }
    }
    let sparse: Vec<(usize, Window)> = (samples.chunk_by(|a, b| a.0 == b.0))
        .filter(|group| group.len() < FEWEST)
        .filter_map(|group| group.first().map(|s| s.0 as usize))
        .map(|cell| (cell, grid.around(cell).fold(CLOSED, |hull, near| hull.with(&windows[near]))))
        .collect();
    sparse.into_iter().for_each(|(cell, window)| windows[cell] = window);
    windows
}

/// The samples sorted by their cells, each counted and put into its place.
fn by_cell(samples: &[Sample], cells: usize) -> Vec<Sample> {
    let mut place = vec![0usize; cells + 1];
    samples.iter().for_each(|s| place[s.0 as usize + 1] += 1);
    for i in 0..cells {
        place[i + 1] += place[i];
    }
    let mut sorted = samples.to_vec();
    for sample in samples {
        let at = &mut place[sample.0 as usize];
        sorted[*at] = *sample;
        *at += 1;
    }
    sorted
}

impl Window {
    /// Whether anything agrees with it.
    fn known(&self) -> bool {
        self.low <= self.high
    }

    #[inline]
    fn holds(&self, z: f32) -> bool {
        z >= self.low && z <= self.high
    }

    /// The window over both.
    fn with(self, other: &Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high) }
    }
}

/// Median ± k robust standard deviations, at least those of the sensor's noise; `values` is room to work in.
fn window(group: &[Sample], noise: &NoiseLaw, values: &mut Vec<f32>) -> Window {
    if group.len() < FEWEST {
        return CLOSED;
    }
    let mut median_of = |value: &dyn Fn(&Sample) -> f32| {
        values.clear();
        values.extend(group.iter().map(value));
        let (_, median, _) = values.select_nth_unstable_by(group.len() / 2, f32::total_cmp); // the upper one
        *median
    };
    let depth = median_of(&|s| s.2);
    let z = median_of(&|s| s.1);
    let scatter = MAD_TO_STD as f32 * median_of(&|s| (s.1 - z).abs());
    let own = noise.sigma(f64::from(depth)) as f32;
    let half = CLUTTER_SIGMAS * scatter.max(own) + 1e-4;
    Window { low: z - half, high: z + half }
}
