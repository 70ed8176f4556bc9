//! A vessel's floor as heights on a square grid about the axis, whatever its shape.

use crate::{Error, Result};

/// A floor's heights z (down) in the silo frame and their standard deviations, rows along y. Metres.
#[derive(Debug, Clone, PartialEq)]
pub struct FloorMap {
    /// Half the side of the square.
    reach: f64,
    /// Cells along a side.
    side: usize,
    z: Vec<f64>,
    std: Vec<f64>,
    /// Whether the camera of the frames has seen it: what its pose and sensor err by is then common to floor and surface.
    pub of_camera: bool,
}

impl FloorMap {
    /// A map of `side` × `side` cells.
    pub fn new(reach: f64, side: usize, z: Vec<f64>, std: Vec<f64>, of_camera: bool) -> Result<Self> {
        let finite = z.iter().chain(&std).all(|v| v.is_finite()) && reach.is_finite() && reach > 0.0;
        if side < 2 || z.len() != side * side || std.len() != z.len() || !finite {
            let value = z.len() as f64;
            return Err(Error::Setting { name: "floor", bounds: "a square of at least 2 x 2 finite heights", value });
        }
        Ok(Self { reach, side, z, std, of_camera })
    }

    /// z of the floor, bilinear between the cells' middles and the nearest one beyond the edge.
    pub fn z(&self, x: f64, y: f64) -> f64 {
        self.between(&self.z, x, y)
    }

    /// Standard deviation of z.
    pub fn std(&self, x: f64, y: f64) -> f64 {
        self.between(&self.std, x, y)
    }

    /// Slopes dz/dx and dz/dy over two cells; beyond the edge, those at it.
    pub fn slopes(&self, x: f64, y: f64) -> [f64; 2] {
        let step = 2.0 * self.reach / self.side as f64;
        let edge = self.reach - 0.5 * step;
        let inner = (edge - step).max(0.0);
        let ends = |v: f64| {
            let middle = v.clamp(-inner, inner);
            [(middle - step).max(-edge), (middle + step).min(edge)]
        };
        let ([west, east], [north, south]) = (ends(x), ends(y));
        [(self.z(east, y) - self.z(west, y)) / (east - west), (self.z(x, south) - self.z(x, north)) / (south - north)]
    }

    /// Height from the edge to the lowest place, and half the side.
    pub fn rise(&self) -> [f64; 2] {
        let (low, high) = self.z.iter().fold((f64::MIN, f64::MAX), |(low, high), &z| (low.max(z), high.min(z)));
        [low - high, self.reach]
    }

    fn between(&self, values: &[f64], x: f64, y: f64) -> f64 {
        let place = |v: f64| {
            let at =
                ((v + self.reach) * self.side as f64 / (2.0 * self.reach) - 0.5).clamp(0.0, self.side as f64 - 1.0);
            let first = (at as usize).min(self.side - 2);
            (first, at - first as f64)
        };
        let ((column, a), (row, b)) = (place(x), place(y));
        let at = |row: usize, column: usize| values.get(row * self.side + column).copied().unwrap_or(f64::NAN);
        (1.0 - b) * ((1.0 - a) * at(row, column) + a * at(row, column + 1))
            + b * ((1.0 - a) * at(row + 1, column) + a * at(row + 1, column + 1))
    }
}

#[cfg(test)]
#[allow(clippy::panic)]
mod tests {
    use super::*;

    fn plane() -> FloorMap {
        let middle = |i: usize| (i as f64 + 0.5) * 0.2 - 1.0;
        let z = (0..100).map(|i| 3.0 + 0.5 * middle(i % 10) - 0.25 * middle(i / 10)).collect();
        let Ok(map) = FloorMap::new(1.0, 10, z, vec![0.01; 100], false) else { panic!("a map") };
        map
    }

    #[test]
    fn a_plane_is_met_between_the_middles() {
        let map = plane();
        for (x, y) in [(0.0, 0.0), (0.33, -0.71), (-0.6, 0.42), (0.9, -0.85)] {
            assert!((map.z(x, y) - (3.0 + 0.5 * x - 0.25 * y)).abs() < 1e-12);
            assert!((map.std(x, y) - 0.01).abs() < 1e-15);
            let [dx, dy] = map.slopes(x, y);
            assert!((dx - 0.5).abs() < 1e-9 && (dy + 0.25).abs() < 1e-9);
        }
        assert!((map.z(5.0, 0.0) - map.z(0.9, 0.0)).abs() < 1e-12);
    }

    #[test]
    fn a_map_that_is_no_square_is_refused() {
        assert!(FloorMap::new(1.0, 10, vec![0.0; 99], vec![0.0; 99], false).is_err());
        assert!(FloorMap::new(1.0, 1, vec![0.0], vec![0.0], false).is_err());
        assert!(FloorMap::new(1.0, 2, vec![f64::NAN; 4], vec![0.0; 4], false).is_err());
    }
}
