//! From a frame and a silo to its content: the page to read first.

use super::bound::Bound;
use super::cells::{Tally, gather};
use super::classify::{Classified, Floor, Thing, classify, extent};
use super::doubt::{Covariance, DEPTH, GEOMETRY, Lever, POSE, Parameters, deviation, share};
use super::drift::settle;
use super::fit::{Surface, WIDER};
use super::grid::Grid;
use super::returns::{Returns, Source};
use super::shape::{Sample, Shape, shape};
use super::sight::{Sight, sight};
use super::trend::Observation;
use super::volume::{Kind, Volume, integrate};
use super::wall::{Shift, shift};
use super::{cells::Cell, detail};
use crate::geometry::sensor::{DepthBias, NoiseLaw};
use crate::geometry::vessel::Vessel;
use crate::{Result, SiloPose};
use nalgebra::DVector;
use std::f64::consts::TAU;

/// What is known before the frame.
#[derive(Debug, Clone)]
pub struct Setup {
    /// Pose of the camera.
    pub pose: SiloPose,
    /// The silo.
    pub vessel: Vessel,
    /// How well pose, geometry and depth bias are known.
    pub covariance: Covariance,
    /// How uneven the wall is, metres (standard deviation).
    pub wall_std: f64,
    /// The sensor's bias, as the calibration has it.
    pub bias: DepthBias,
    /// The sensor's noise.
    pub noise: NoiseLaw,
    /// Whether that is the sensor's own noise and no guess.
    pub noise_known: bool,
    /// Depths that the sensor can measure.
    pub range: [f64; 2],
}

/// Standard deviations of the volume, cubic metres.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Doubts {
    /// By the camera's pose.
    pub pose: f64,
    /// By the silo's geometry.
    pub geometry: f64,
    /// By the sensor's systematic depth error, of which a scale error is a part.
    pub depth: f64,
    /// By the sensor's noise.
    pub noise: f64,
    /// By what is not seen of the surface.
    pub unseen: f64,
    /// By the grid.
    pub grid: f64,
    /// All together, with the correlations of pose, geometry and depth.
    pub total: f64,
}

/// The content of one frame.
#[derive(Debug, Clone)]
pub struct Content {
    /// The cells.
    pub grid: Grid,
    /// What the returns over each cell say.
    pub cells: Vec<Cell>,
    /// What each cell shows.
    pub kinds: Vec<Kind>,
    /// The surface; None where hardly any cell shows content.
    pub surface: Option<Surface>,
    /// The volume under it.
    pub volume: Option<Volume>,
    /// How sure it is.
    pub doubts: Doubts,
    /// Derivatives of the volume by the calibration's parameters.
    pub derivatives: Parameters,
    /// Things above the surface.
    pub things: Vec<Thing>,
    /// Steep holes in the surface.
    pub holes: Vec<Thing>,
    /// The surface's shape, from the cells that show it.
    pub shape: Option<Shape>,
    /// Distances from the axis of the nearest and the farthest cell that shows the bare floor.
    pub bare: Option<[f64; 2]>,
    /// Share of the seen cells that lie surely below the floor.
    pub sunken: f64,
    /// Counts of the frame.
    pub tally: Tally,
    /// How much the sensor sees.
    pub sight: Sight,
    /// Whether the wall still lies where the calibration has it.
    pub shift: Option<Shift>,
}

/// Measures the content.
pub fn measure(source: Source<'_>, setup: &Setup) -> Result<Content> {
    let seen = Seen::new(source, setup)?;
    let floor = seen.floor(setup);
    let Classified { kinds, surface, things, holes, sunken } = classify(&seen.grid, &seen.cells, &floor);
    let Seen { returns, grid, lever, cells, tally } = seen;
    let volume = surface.as_ref().map(|s| integrate(s, &setup.vessel, &kinds));
    let (doubts, derivatives) = match (&surface, &volume) {
        (Some(surface), Some(volume)) => doubts(surface, volume, &cells, &lever, setup),
        _ => (Doubts::default(), Parameters::zeros()),
    };
    let shape = surface.as_ref().and_then(|s| shape_of(s, &cells, setup.vessel.radius));
    let sight = sight(source, &returns, &setup.vessel, &setup.pose, setup.range);
    let shift = shift(&returns, &setup.vessel, &lever, &setup.noise, &setup.covariance, surface.as_ref());
    let bare = extent(&grid, (0..grid.count()).filter(|&i| matches!(kinds[i], Kind::Bare | Kind::Rim)));
    Ok(Content {
        grid,
        cells,
        kinds,
        surface,
        volume,
        doubts,
        derivatives,
        things,
        holes,
        shape,
        bare,
        sunken,
        tally,
        sight,
        shift,
    })
}

/// Distance from the axis of the farthest bare wall that a frame shows, and the size of the cells that tell.
pub fn bare_reach(source: Source<'_>, setup: &Setup) -> Result<Option<[f64; 2]>> {
    let seen = Seen::new(source, setup)?;
    let bare = seen.floor(setup).bare(&seen.cells, &seen.grid);
    Ok(bare.map(|[_, far]| [far, seen.grid.cell()]))
}

/// What the returns say over each cell.
struct Seen<'a> {
    returns: Returns<'a>,
    grid: Grid,
    lever: Lever,
    cells: Vec<Cell>,
    tally: Tally,
}

impl<'a> Seen<'a> {
    fn new(source: Source<'a>, setup: &Setup) -> Result<Self> {
        setup.vessel.validate()?;
        let returns = Returns::new(source, setup.bias, &setup.pose, setup.vessel.ovality);
        let grid = Grid::over_disc([0.0, 0.0], setup.vessel.radius, returns.len());
        let lever = Lever::new(&setup.pose, setup.bias);
        let bound = bound(setup);
        let (mut cells, tally) = gather(&returns, &bound, &grid, &setup.noise, &lever);
        if setup.noise_known {
            settle(&mut cells, &grid, &bound, &setup.noise, &lever);
        }
        Ok(Self { returns, grid, lever, cells, tally })
    }

    fn floor<'b>(&'b self, setup: &'b Setup) -> Floor<'b> {
        Floor { vessel: &setup.vessel, lever: &self.lever, covariance: &setup.covariance, wall_std: setup.wall_std }
    }
}

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

/// The cylinder with the variance of a point's distance to it.
fn bound(setup: &Setup) -> Bound {
    let c = &setup.covariance;
    let constant = c[(2, 2)].max(c[(3, 3)]) + c[(4, 4)] + setup.wall_std * setup.wall_std;
    let by_depth = c[(0, 0)].max(c[(1, 1)]) + c[(8, 8)];
    let vessel = &setup.vessel;
    let reach = 2.0 * (vessel.apex.abs() + vessel.radius + vessel.outlet_length);
    let camera = [setup.pose.t_x, setup.pose.t_y];
    Bound::new(vessel.radius, [constant, by_depth], &setup.noise, reach, vessel.top, camera)
}

/// How much the volume shrinks for each metre that a cell's height z is larger.
fn influences(surface: &Surface, volume: &Volume) -> (Vec<f64>, DVector<f64>) {
    let reach = surface.grid.reach;
    let rough = (surface.roughness / reach).powi(2);
    let mut known = vec![false; surface.grid.count()];
    surface.used.iter().for_each(|(i, _)| known[*i] = true);
    let own = if rough > 0.0 { detail::gather(&surface.grid, &known, &volume.cells) } else { vec![0.0; known.len()] };
    let mut left = volume.functions.clone();
    let mut kept = Vec::with_capacity(surface.used.len());
    for (i, o) in &surface.used {
        let weight = own[*i] * surface.kept(*i);
        o.row.iter().for_each(|(j, value)| left[j] -= weight * value * reach);
        kept.push(weight);
    }
    let spread = surface.trend.spread(&left);
    let through =
        |o: &Observation| o.row.iter().map(|(j, value)| spread[j] * value).sum::<f64>() / (o.variance * reach);
    let all = surface.used.iter().zip(kept).map(|((_, o), weight)| weight + through(o)).collect();
    (all, left)
}

fn doubts(surface: &Surface, volume: &Volume, cells: &[Cell], lever: &Lever, setup: &Setup) -> (Doubts, Parameters) {
    let covariance = &setup.covariance;
    let (influences, left) = influences(surface, volume);
    let mut derivatives = Parameters::zeros();
    let mut noise = 0.0;
    for (((i, _), slopes), influence) in surface.used.iter().zip(&surface.slopes).zip(influences) {
        let cell = &cells[*i];
        derivatives -= influence * lever.heights(cell.mean, *slopes);
        noise += influence * influence * cell.variance;
    }
    derivatives[4] += volume.geometry.radius;
    derivatives[5] += volume.geometry.cylinder_bottom;
    derivatives[6] += volume.geometry.apex;
    let patch = surface.patch * surface.grid.cell().powi(2);
    let hidden = (volume.area - volume.seen).max(0.0) * patch * surface.roughness.powi(2);
    let continued = (left.dot(&surface.trend.spread(&left)) - noise).max(0.0);
    let unseen = WIDER * WIDER * continued + hidden;
    let grid = grid_error(&surface.grid, volume, &setup.vessel);
    let known = deviation(&derivatives, covariance).powi(2);
    let out = Doubts {
        pose: share(&derivatives, covariance, POSE),
        geometry: share(&derivatives, covariance, GEOMETRY),
        depth: share(&derivatives, covariance, DEPTH),
        noise: noise.sqrt(),
        unseen: unseen.sqrt(),
        grid,
        total: (known + noise + unseen + grid * grid).sqrt(),
    };
    (out, derivatives)
}

/// Mean height error that the cells leave, metres.
const CELL_ERROR: f64 = 3e-5;
/// Error of the wedge of content under the cells at its rim on the cone, as a share of cell² · slope · length.
const RIM_ERROR: f64 = 0.005;

/// What the cells leave of the volume, as measured on exact frames.
fn grid_error(grid: &Grid, volume: &Volume, vessel: &Vessel) -> f64 {
    let rim = TAU * volume.reach * (1.0 - volume.wall_share);
    let wedge = grid.cell().powi(2) * vessel.cone_height() / vessel.radius * rim;
    (CELL_ERROR * volume.area).hypot(RIM_ERROR * wedge)
}
