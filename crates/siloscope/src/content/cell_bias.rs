//! What noise does to the cells: it moves returns along their rays, and so from cell to cell.
//!
//! Where the returns lie denser on one side, more come from there than go back. By how much the depths of a cell's
//! returns are wrong on the mean follows from the flow through its four sides: `Σ δ = -σ² Σ_sides n (ray · side)` with the
//! density n of the returns at each side (the linear form of Tweedie's formula). Without the correction a surface would
//! tilt by some tenths of a millimetre per metre, and more where it is continued.

use super::bound::{Bound, STEP, Side};
use super::cells::Cell;
use super::grid::Grid;
use super::jacobian::CalibrationJacobian;
use crate::geometry::sensor::NoiseLaw;

/// Takes the drift out of the cells' means.
pub fn remove_cell_bias(
    cells: &mut [Cell],
    grid: &Grid,
    bound: &Bound,
    noise: &NoiseLaw,
    jacobian: &CalibrationJacobian,
) {
    let whole: Vec<bool> = (0..cells.len()).map(|i| clears(bound, grid.middle(i), grid.cell(), &cells[i])).collect();
    let drifts: Vec<[f64; 3]> = (0..cells.len()).map(|i| drift(i, cells, &whole, grid, noise, jacobian)).collect();
    for (cell, drift) in cells.iter_mut().zip(drifts) {
        cell.mean = [0, 1, 2].map(|k| cell.mean[k] - drift[k]);
    }
}

/// Whether the wall takes no return from a cell with this middle and side.
fn clears(bound: &Bound, [x, y]: [f64; 2], side: f64, cell: &Cell) -> bool {
    let far = x.hypot(y) + 0.5 * f64::sqrt(2.0) * side;
    let [px, py, pz] = cell.mean.map(|m| m as f32);
    let out = far as f32 / px.hypot(py).max(1e-6);
    !cell.seen() && far < bound.radius()
        || cell.seen() && bound.side([px * out, py * out, pz], pz.max(STEP)) == Side::Inside
}

/// How far a cell's mean is off, metres.
fn drift(
    i: usize,
    cells: &[Cell],
    whole: &[bool],
    grid: &Grid,
    noise: &NoiseLaw,
    jacobian: &CalibrationJacobian,
) -> [f64; 3] {
    let cell = &cells[i];
    let (column, row) = (i % grid.side, i / grid.side);
    if !cell.seen() || !whole[i] {
        return [0.0; 3];
    }
    let side = |there: bool, j: usize| if there { density(cell, cells.get(j), whole.get(j)) } else { cell.count };
    let across = side(column + 1 < grid.side, i + 1) - side(column > 0, i.wrapping_sub(1));
    let along = side(row + 1 < grid.side, i + grid.side) - side(row > 0, i.wrapping_sub(grid.side));
    let ray = jacobian.ray(cell.mean);
    let depth = jacobian.depth(cell.mean);
    let sigma = noise.sigma(depth) / jacobian.gain(depth);
    let mean = -sigma * sigma * (ray[0] * across + ray[1] * along) / (grid.cell() * cell.count);
    ray.map(|r| r * mean.clamp(-sigma, sigma))
}

/// SiloPoints a cell at the side between a cell and its neighbour: where one of them is cut by the edge of the view, the
/// side has what the fuller one has; beyond the edge it has none. A neighbour that the wall cuts off tells nothing.
fn density(cell: &Cell, beside: Option<&Cell>, whole: Option<&bool>) -> f64 {
    match (beside, whole) {
        (Some(other), Some(true)) if other.seen() => cell.count.max(other.count),
        (Some(_), Some(true)) => 0.0,
        _ => cell.count,
    }
}

#[cfg(test)]
#[allow(clippy::panic)]
mod tests {
    use super::*;
    use crate::content::cells::gather;
    use crate::content::silo_points::{SiloPoints, Source};
    use crate::geometry::depth_image::DepthImage;
    use crate::geometry::sensor::DepthBias;
    use crate::{Camera, Distortion, SiloPose};

    const SIGMA: f64 = 0.05;

    /// Twelve uniform numbers less six: as good as normal here.
    fn normal(state: &mut u64) -> f64 {
        let mut uniform = || {
            *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (*state >> 11) as f64 / (1u64 << 53) as f64
        };
        (0..12).map(|_| uniform()).sum::<f64>() - 6.0
    }

    /// Slope of the plane through the cells, which is 0.5 in truth, with and without the correction. The camera looks to
    /// one side, so that noise moves the far returns outwards.
    fn slopes(seed: u64) -> [f64; 2] {
        let distortion = Distortion::None;
        let camera = Camera { width: 320, height: 240, fx: 570.0, fy: 285.0, cx: 0.0, cy: 119.5, distortion };
        let mut state = seed;
        let depth: Vec<f32> =
            (camera.rays().iter()).map(|[x, _]| (3.0 / (1.0 - 0.5 * x) + SIGMA * normal(&mut state)) as f32).collect();
        let (pose, noise) = (SiloPose::default(), NoiseLaw::uniform(SIGMA));
        let Ok(image) = DepthImage::new(&depth, &camera, None) else { panic!("a frame") };
        let returns = SiloPoints::new(Source::Depth(image), DepthBias::default(), &pose, [0.0; 2]);
        let grid = Grid { centre: [0.0; 2], reach: 3.0, side: 32 };
        let bound = Bound::new(6.0, [0.0; 2], &noise, 10.0, 0.0, [0.0; 2]);
        let jacobian = CalibrationJacobian::new(&pose, DepthBias::default());
        let (mut cells, _) = gather(&returns, &bound, &grid, &noise, &jacobian);
        let before = slope(&cells);
        remove_cell_bias(&mut cells, &grid, &bound, &noise, &jacobian);
        [before, slope(&cells)]
    }

    fn slope(cells: &[Cell]) -> f64 {
        let sum = |of: &dyn Fn(&Cell) -> f64| {
            cells.iter().map(|c| c.count * of(c)).sum::<f64>() / cells.iter().map(|c| c.count).sum::<f64>()
        };
        let (x, z) = (sum(&|c| c.mean[0]), sum(&|c| c.mean[2]));
        sum(&|c| (c.mean[0] - x) * (c.mean[2] - z)) / sum(&|c| (c.mean[0] - x).powi(2))
    }

    #[test]
    fn noise_along_the_rays_does_not_tilt_a_plane() {
        let all: Vec<[f64; 2]> = (1..9).map(slopes).collect();
        let [before, after] = [0, 1].map(|k| all.iter().map(|s| s[k] - 0.5).sum::<f64>() / all.len() as f64);
        assert!(before.abs() > 1e-3, "{before}");
        assert!(after.abs() < 0.3 * before.abs(), "{before} {after}");
    }
}
