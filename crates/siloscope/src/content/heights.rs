//! The heights of a surface alone, without what its deviations rest on: what a result keeps.

use super::basis::Basis;
use super::detail;
use super::fit::{Surface, unit};
use super::grid::Grid;

/// z of a surface as a function of x and y.
#[derive(Debug, Clone)]
pub struct Heights {
    /// The cells.
    pub grid: Grid,
    /// The trend's functions.
    pub basis: Basis,
    /// Coefficients of the trend, in units of the grid's reach.
    pub coefficients: Vec<f64>,
    /// z of the trend's zero.
    pub datum: f64,
    /// What the cells add to the trend, metres down.
    pub detail: Vec<f64>,
}

impl Heights {
    /// z at a place.
    pub fn at(&self, x: f64, y: f64) -> f64 {
        let trend = self.basis.height(unit(&self.grid, [x, y, 0.0]), &self.coefficients);
        self.datum + trend * self.grid.reach + detail::between(&self.grid, &self.detail, x, y)
    }
}

impl From<&Surface> for Heights {
    fn from(surface: &Surface) -> Self {
        Self {
            grid: surface.grid,
            basis: surface.basis.clone(),
            coefficients: surface.trend.coefficients.as_slice().to_vec(),
            datum: surface.datum,
            detail: surface.detail.clone(),
        }
    }
}

#[cfg(test)]
#[allow(clippy::panic)]
mod tests {
    use super::*;
    use crate::content::cells::Cell;
    use crate::content::fit::{fit, sketch};

    #[test]
    fn kept_heights_are_the_surfaces() {
        let grid = Grid { centre: [0.1, -0.2], reach: 1.5, side: 14 };
        let cell = |i: usize| {
            let [x, y] = grid.middle(i);
            Cell { count: 40.0, mean: [x, y, 3.0 + 0.2 * x + 0.1 * (3.0 * y).sin()], variance: 1e-6 }
        };
        let cells: Vec<Cell> = (0..grid.count()).map(cell).collect();
        let take = vec![true; grid.count()];
        let Some(surface) = sketch(&grid, &cells, &take).and_then(|sketch| fit(&sketch, &cells, &take)) else {
            panic!("a surface")
        };
        let heights = Heights::from(&surface);
        let again = Heights { basis: Basis::new(heights.basis.centre), ..heights.clone() };
        for i in 0..100 {
            let (x, y) = (1.5 * f64::from(i).sin(), 1.5 * f64::from(3 * i).cos());
            assert_eq!(surface.height(x, y).to_bits(), heights.at(x, y).to_bits());
            assert_eq!(surface.height(x, y).to_bits(), again.at(x, y).to_bits());
        }
    }
}
