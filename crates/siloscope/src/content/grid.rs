//! The square grid over a silo's disc.

/// Square cells over the square `[-reach, reach]²` about a centre, row by row from the lowest y.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Grid {
    /// Centre of the square.
    pub centre: [f64; 2],
    /// Half the square's side, metres.
    pub reach: f64,
    /// Cells along a side.
    pub side: usize,
}

/// Fewest and most cells along a side.
const SIDES: (usize, usize) = (12, 32);
/// SiloPoints wanted in a cell.
const WANTED: f64 = 40.0;

impl Grid {
    /// A grid over a disc that `returns` returns cover: so fine that a cell has some forty of them.
    pub fn over_disc(centre: [f64; 2], reach: f64, returns: usize) -> Self {
        let cells = returns as f64 / WANTED * 4.0 / std::f64::consts::PI;
        let side = (cells.sqrt() as usize).clamp(SIDES.0, SIDES.1);
        Self { centre, reach, side }
    }

    /// Number of cells.
    pub fn count(&self) -> usize {
        self.side * self.side
    }

    /// Side of a cell, metres.
    pub fn cell(&self) -> f64 {
        2.0 * self.reach / self.side as f64
    }

    /// Cell of a place, if it is on the grid.
    #[inline]
    pub fn index(&self, x: f64, y: f64) -> Option<usize> {
        let scale = self.side as f64 / (2.0 * self.reach);
        let column = (x - self.centre[0] + self.reach) * scale;
        let row = (y - self.centre[1] + self.reach) * scale;
        let side = self.side as f64;
        let inside = column >= 0.0 && column < side && row >= 0.0 && row < side;
        inside.then(|| row as usize * self.side + column as usize)
    }

    /// Centre of a cell.
    pub fn middle(&self, index: usize) -> [f64; 2] {
        let at = |i: usize| (i as f64 + 0.5) * self.cell() - self.reach;
        [at(index % self.side) + self.centre[0], at(index / self.side) + self.centre[1]]
    }

    /// The cells beside a cell: left, right, below, above, where they exist.
    pub fn beside(&self, index: usize) -> impl Iterator<Item = usize> + use<> {
        let (side, column, row) = (self.side, index % self.side, index / self.side);
        [
            (column > 0).then(|| index - 1),
            (column + 1 < side).then_some(index + 1),
            (row > 0).then(|| index - side),
            (row + 1 < side).then_some(index + side),
        ]
        .into_iter()
        .flatten()
    }

    /// The up to eight cells about a cell.
    pub fn around(&self, index: usize) -> impl Iterator<Item = usize> + use<> {
        let (side, column, row) = (self.side as isize, (index % self.side) as isize, (index / self.side) as isize);
        let steps = [(-1, -1), (0, -1), (1, -1), (-1, 0), (1, 0), (-1, 1), (0, 1), (1, 1)];
        steps.into_iter().map(move |(dx, dy)| (column + dx, row + dy)).filter_map(move |(c, r)| {
            let on = (0..side).contains(&c) && (0..side).contains(&r);
            on.then(|| (r * side + c) as usize)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cell_holds_its_middle_and_has_its_neighbours() {
        let grid = Grid { centre: [0.3, -0.2], reach: 1.5, side: 7 };
        for i in 0..grid.count() {
            let [x, y] = grid.middle(i);
            assert_eq!(grid.index(x, y), Some(i));
            assert!(grid.beside(i).all(|j| grid.around(i).any(|k| k == j)));
            assert!(grid.around(i).all(|j| grid.around(j).any(|k| k == i)));
        }
        assert_eq!(grid.around(0).count(), 3);
        assert_eq!(grid.beside(24).count(), 4);
        for (x, y) in [(1.81, 0.0), (f64::NAN, 0.0), (0.0, f64::INFINITY), (0.0, -1.71)] {
            assert_eq!(grid.index(x, y), None);
        }
    }
}
