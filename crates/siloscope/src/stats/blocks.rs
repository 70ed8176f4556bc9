//! Blocks of neighbouring points: their errors go together, those of different blocks hardly do.

use crate::Vec3;
use std::collections::HashMap;

/// Number of the block of every point, counted from 0, and how many there are; cubes with side `size`.
pub fn blocks(points: impl Iterator<Item = Vec3>, size: f64) -> (Vec<usize>, usize) {
    let mut known: HashMap<[i64; 3], usize> = HashMap::new();
    let mut block = |p: Vec3| {
        let cube = [p.x, p.y, p.z].map(|c| (c / size).floor() as i64);
        let next = known.len();
        *known.entry(cube).or_insert(next)
    };
    let numbers: Vec<usize> = points.map(&mut block).collect();
    (numbers, known.len())
}

/// Sums of N numbers over each block.
pub fn sums<const N: usize>(terms: impl Iterator<Item = (usize, [f64; N])>, blocks: usize) -> Vec<[f64; N]> {
    let mut sums = vec![[0.0; N]; blocks];
    for (block, term) in terms {
        sums[block].iter_mut().zip(term).for_each(|(sum, t)| *sum += t);
    }
    sums
}
