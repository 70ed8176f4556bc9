//! Tiles in blocks of 2 × 2: those of a part in a block count as one in the normal equations, with their mean row.

use crate::geometry::surface::Part;
use crate::surface_fit::joint::parameters::CYLINDER_END;
use crate::surface_fit::joint::system::{Accumulator, Quadratic};

/// Blocks that are added up as the tiles come, row by row.
#[derive(Debug)]
pub struct Blocks {
    sums: Accumulator,
    open: Vec<[Option<Block>; 2]>,
    band: u32,
}

impl Blocks {
    /// Of tiles in so many columns.
    pub fn new(columns: usize) -> Self {
        Self { sums: Accumulator::default(), open: vec![[None, None]; columns / 2 + 1], band: 0 }
    }

    /// Adds the row of a tile of a part, in the order of the tiles.
    pub fn add(&mut self, tile: (u32, u32), part: Part, row: &[f64], (residual, weight): (f64, f64)) {
        if tile.1 / 2 != self.band {
            self.flush();
            self.band = tile.1 / 2;
        }
        let parts = &mut self.open[tile.0 as usize / 2];
        parts[usize::from(part == Part::Cone)].get_or_insert_default().add(row, residual, weight);
    }

    /// The sum of squares of all blocks.
    pub fn quadratic(mut self) -> Quadratic {
        self.flush();
        self.sums.quadratic()
    }

    fn flush(&mut self) {
        self.open.iter_mut().for_each(|parts| flush(parts, &mut self.sums));
    }
}

/// Tiles of one part in a block of 2 × 2: their weighted sums.
#[derive(Debug, Clone)]
struct Block {
    row: [f64; CYLINDER_END],
    width: usize,
    residual: f64,
    weight: f64,
}

impl Default for Block {
    fn default() -> Self {
        Self { row: [0.0; CYLINDER_END], width: 0, residual: 0.0, weight: 0.0 }
    }
}

impl Block {
    #[inline]
    fn add(&mut self, row: &[f64], residual: f64, weight: f64) {
        self.row.iter_mut().zip(row).for_each(|(sum, value)| *sum += weight * value);
        self.width = row.len();
        self.residual += weight * residual;
        self.weight += weight;
    }
}

fn flush(parts: &mut [Option<Block>; 2], sums: &mut Accumulator) {
    for (block, part) in parts.iter_mut().zip([Part::Cylinder, Part::Cone]) {
        if let Some(Block { row, width, residual, weight }) = block.take() {
            // Σw (Σw J / Σw)(Σw J / Σw)ᵀ = (Σw J)(Σw J)ᵀ / Σw
            sums.add(part, &row[..width], residual, 1.0 / weight);
        }
    }
}
