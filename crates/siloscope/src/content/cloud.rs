//! The surface of a bare point cloud with a given vertical, where no silo is known.

use super::bound::Bound;
use super::cells::{Cell, gather};
use super::fit::{Surface, fit, sketch};
use super::grid::Grid;
use super::jacobian::CalibrationJacobian;
use super::silo_points::{SiloPoints, Source};
use super::volume::Kind;
use crate::geometry::sensor::{DepthBias, NoiseLaw};
use crate::{Error, Result, SiloPose, Vec3};
use nalgebra::Matrix3;

/// A surface over a square, heights upwards along the given vertical.
#[derive(Debug, Clone)]
pub struct Relief {
    /// The cells, in the horizontal plane's own axes.
    pub grid: Grid,
    /// What the points over each cell say.
    pub cells: Vec<Cell>,
    /// Which cells are seen.
    pub kinds: Vec<Kind>,
    /// The surface, z down from `ceiling`.
    pub surface: Surface,
    /// Height of z = 0.
    pub ceiling: f64,
    /// Rows: the horizontal axes and up, in the cloud's axes.
    pub axes: Matrix3<f64>,
}

/// Fewest points that make a surface.
const FEWEST: usize = 50;
/// Height above the highest point at which the cloud is looked at from, in units of its extent.
const ABOVE: f64 = 1.0;

impl Relief {
    /// Maps points; `up` has any length, `cell` is the side of a cell, chosen from the points where it is None.
    ///
    /// Points that are not finite are left out.
    pub fn new(points: &[[f64; 3]], up: &Vec3, cell: Option<f64>, noise: f64) -> Result<Option<Self>> {
        let axes = axes(up)?;
        let turned: Vec<Vec3> = (points.iter().map(|&p| axes * Vec3::from(p)))
            .filter(|p| p.iter().all(|x| x.is_finite() && x.abs() < 1e6))
            .collect();
        let Some(extent) = Extent::of(&turned).filter(|_| turned.len() >= FEWEST) else { return Ok(None) };
        let grid = extent.grid(cell, turned.len())?;
        let ceiling = extent.high + ABOVE * extent.reach;
        let [cx, cy] = extent.middle;
        let down: Vec<[f32; 3]> =
            turned.iter().map(|p| [(p.x - cx) as f32, (p.y - cy) as f32, (ceiling - p.z) as f32]).collect();
        let centred = Grid { centre: [0.0, 0.0], ..grid };
        let noise = NoiseLaw::uniform(noise);
        let pose = SiloPose::default();
        let returns = SiloPoints::new(Source::Points(&down), DepthBias::default(), &pose, [0.0; 2]);
        let bound = Bound::new(10.0 * extent.reach, [0.0; 2], &noise, 0.0, f64::MIN, [0.0; 2]);
        let (mut cells, _) =
            gather(&returns, &bound, &centred, &noise, &CalibrationJacobian::new(&pose, DepthBias::default()));
        for cell in cells.iter_mut().filter(|c| c.seen()) {
            cell.mean = [cell.mean[0] + cx, cell.mean[1] + cy, cell.mean[2]];
        }
        let seen: Vec<bool> = cells.iter().map(Cell::seen).collect();
        let kinds = seen.iter().map(|&s| if s { Kind::Feed } else { Kind::Unseen }).collect();
        let surface = sketch(&grid, &cells, &seen).and_then(|sketch| fit(&sketch, &cells, &seen));
        Ok(surface.map(|surface| Self { grid, cells, kinds, surface, ceiling, axes }))
    }

    /// Height of the surface at a place of the horizontal plane.
    pub fn height(&self, x: f64, y: f64) -> f64 {
        self.ceiling - self.surface.height(x, y)
    }
}

/// Where the points lie.
struct Extent {
    middle: [f64; 2],
    reach: f64,
    high: f64,
}

impl Extent {
    fn of(points: &[Vec3]) -> Option<Self> {
        let first = points.first()?;
        let (low, high) = points.iter().fold((*first, *first), |(low, high), p| (low.inf(p), high.sup(p)));
        let reach = 0.5 * (high.x - low.x).max(high.y - low.y);
        let middle = [0.5 * (low.x + high.x), 0.5 * (low.y + high.y)];
        (reach > 1e-6).then_some(Self { middle, reach: reach * 1.0001, high: high.z })
    }

    fn grid(&self, cell: Option<f64>, points: usize) -> Result<Grid> {
        let Some(cell) = cell else { return Ok(Grid::over_disc(self.middle, self.reach, points)) };
        let side = 2.0 * self.reach / cell;
        if !(4.0..=200.0).contains(&side) {
            let bounds = "between 1/200 and 1/4 of the cloud's extent";
            return Err(Error::Setting { name: "cell", bounds, value: cell });
        }
        Ok(Grid { centre: self.middle, reach: self.reach, side: side.ceil() as usize })
    }
}

/// Horizontal axes beside `up`: the cloud's own x, y where z is up, else the nearest to them.
fn axes(up: &Vec3) -> Result<Matrix3<f64>> {
    let norm = up.norm();
    if !(norm.is_finite() && norm > 1e-9) {
        return Err(Error::Setting { name: "up", bounds: "a finite direction", value: norm });
    }
    let up = up / norm;
    let along = if up.x.abs() < 0.9 { Vec3::x() } else { Vec3::y() };
    let x = (along - up * up.dot(&along)).normalize();
    let y = up.cross(&x);
    Ok(Matrix3::from_rows(&[x.transpose(), y.transpose(), up.transpose()]))
}

#[cfg(test)]
#[allow(clippy::panic)]
mod tests {
    use super::*;

    fn heap(up: Vec3) -> Relief {
        let Ok(axes) = axes(&up) else { panic!("a direction") };
        let on = |i: i32| f64::from(i) * 0.02;
        let square = (-60..=60).flat_map(|i| (-60..=60).map(move |j| [on(i), on(j)]));
        let point = |[x, y]: [f64; 2]| Vec3::new(x + 3.0, y - 1.0, 0.4 - 0.5 * (x - 0.2).hypot(y));
        let points: Vec<[f64; 3]> = square.map(|p| (axes.transpose() * point(p)).into()).collect();
        match Relief::new(&points, &up, None, 0.001) {
            Ok(Some(relief)) => relief,
            other => panic!("a surface, not {other:?}"),
        }
    }

    #[test]
    fn heights_are_those_of_the_points_whatever_the_vertical() {
        for up in [Vec3::z(), -Vec3::z(), Vec3::x(), Vec3::new(0.3, -2.0, 0.5)] {
            let relief = heap(up);
            for (x, y) in [(3.9, -1.5), (2.4, -0.3), (3.0, -1.0)] {
                let truth = 0.4 - 0.5 * (x - 3.2_f64).hypot(y + 1.0);
                assert!((relief.height(x, y) - truth).abs() < 0.003, "{up:?} {x} {y} {}", relief.height(x, y));
            }
        }
    }

    #[test]
    fn too_few_points_have_no_surface_and_bad_settings_are_refused() {
        assert!(matches!(Relief::new(&[[0.0; 3]; 60], &Vec3::z(), None, 0.001), Ok(None)));
        assert!(matches!(Relief::new(&[], &Vec3::z(), None, 0.001), Ok(None)));
        assert!(Relief::new(&[], &Vec3::zeros(), None, 0.001).is_err());
        let spread: Vec<[f64; 3]> = (0..100).map(|i| [f64::from(i), f64::from(i % 7), 0.0]).collect();
        assert!(Relief::new(&spread, &Vec3::z(), Some(1e-3), 0.001).is_err());
        let broken: Vec<[f64; 3]> = (0..100).map(|_| [f64::NAN; 3]).collect();
        assert!(matches!(Relief::new(&broken, &Vec3::z(), None, 0.001), Ok(None)));
    }
}
