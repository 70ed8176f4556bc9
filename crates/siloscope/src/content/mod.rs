//! What is in the silo: from a frame to the surface of the content and the volume under it. Read this page first.

pub mod basis;
pub mod bound;
pub mod cell_bias;
pub mod cells;
pub mod classify;
pub mod cloud;
pub mod detail;
pub mod fit;
pub mod grid;
pub mod heights;
pub mod hidden;
pub mod jacobian;
pub mod roughness;
pub mod setup;
pub mod shape;
pub mod silo_points;
pub mod trend;
pub mod uncertainty;
pub mod under;
pub mod visibility;
pub mod volume;
pub mod wall_shift;

pub use self::setup::Setup;
pub use self::shape::shape_of;

use self::cell_bias::remove_cell_bias;
use self::cells::{Cell, Counts, gather};
use self::classify::{Classified, Floor, Thing, classify, extent};
use self::fit::Surface;
use self::grid::Grid;
use self::hidden::hidden;
use self::jacobian::{CalibrationJacobian, Parameters};
use self::shape::Shape;
use self::silo_points::{SiloPoints, Source};
use self::uncertainty::{UncertaintyBudget, uncertainty_budget};
use self::visibility::{Visibility, visibility};
use self::volume::{Kind, Volume, integrate};
use self::wall_shift::{Shift, shift};
use crate::Result;

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
    pub doubts: UncertaintyBudget,
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
    /// Most that the unseen floor can hide where no surface is seen, m³; else 0.
    pub hidden: f64,
    /// Share of the seen cells that lie surely below the floor.
    pub sunken: f64,
    /// Counts of the frame.
    pub tally: Counts,
    /// How much the sensor sees.
    pub sight: Visibility,
    /// Whether the wall still lies where the calibration has it.
    pub shift: Option<Shift>,
}

/// Measures the content.
pub fn measure(source: Source<'_>, setup: &Setup) -> Result<Content> {
    let seen = Seen::new(source, setup)?;
    let floor = seen.floor(setup);
    let Classified { kinds, surface, things, holes, sunken } = classify(&seen.grid, &seen.cells, &floor);
    let Seen { returns, grid, jacobian, cells, tally } = seen;
    let volume = surface.as_ref().map(|s| integrate(s, &setup.under(), &kinds, &cells));
    let (doubts, derivatives) = match (&surface, &volume) {
        (Some(surface), Some(volume)) => uncertainty_budget(surface, volume, &cells, &jacobian, setup),
        _ => (UncertaintyBudget::default(), Parameters::zeros()),
    };
    let shape = surface.as_ref().and_then(|s| shape_of(s, &cells, setup.vessel.radius));
    let sight = visibility(source, &returns, &setup.vessel, &setup.pose, setup.range);
    let shift = shift(&returns, &setup.vessel, &jacobian, &setup.noise, &setup.covariance, surface.as_ref());
    let bare = extent(&grid, (0..grid.count()).filter(|&i| matches!(kinds[i], Kind::Bare | Kind::Rim)));
    let hidden = if surface.is_some() { 0.0 } else { hidden(&grid, &kinds, &setup.under()) };
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
        hidden,
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
    returns: SiloPoints<'a>,
    grid: Grid,
    jacobian: CalibrationJacobian,
    cells: Vec<Cell>,
    tally: Counts,
}

impl<'a> Seen<'a> {
    fn new(source: Source<'a>, setup: &Setup) -> Result<Self> {
        setup.vessel.validate()?;
        let returns = SiloPoints::new(source, setup.bias, &setup.pose, setup.vessel.ovality);
        let grid = Grid::over_disc([0.0, 0.0], setup.vessel.radius, returns.len());
        let jacobian = CalibrationJacobian::new(&setup.pose, setup.bias);
        let bound = setup.bound();
        let (mut cells, tally) = gather(&returns, &bound, &grid, &setup.noise, &jacobian);
        if setup.noise_known {
            remove_cell_bias(&mut cells, &grid, &bound, &setup.noise, &jacobian);
        }
        Ok(Self { returns, grid, jacobian, cells, tally })
    }

    fn floor<'b>(&'b self, setup: &'b Setup) -> Floor<'b> {
        Floor {
            under: setup.under(),
            jacobian: &self.jacobian,
            covariance: &setup.covariance,
            wall_std: setup.wall_std,
        }
    }
}
