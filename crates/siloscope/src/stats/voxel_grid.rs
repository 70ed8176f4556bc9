//! Step 1, second half: one point a voxel.

use crate::base::workers::Workers;
use crate::{Error, Result, Vec3};
use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};
use std::ops::Range;

/// Voxels counted from the origin to either side along each axis: 50 km at the default size.
pub const REACH: f64 = 1_048_575.0;

/// Fractional bits of a position, counted in voxels.
const FRACTION: u32 = 31;
/// Adding this leaves a position's fixed-point form, `FRACTION` bits after the point, in the low bits of the float:
/// rounding is the adder's own, and sums of integers don't depend on their order.
const TO_FIXED: f64 = (1_u64 << (52 - FRACTION)) as f64;
/// Moves every position within reach to the positive side.
const SHIFT: f64 = 1_048_576.0;
const ONE: u64 = 1 << FRACTION;
const INDEX_BITS: u32 = 52 - FRACTION;

/// The mean point of every occupied voxel, in order of the voxels (x, then y, then z), whatever the points' order.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Cloud {
    /// Mean points, metres.
    pub points: Vec<Vec3>,
    /// Number of points behind each mean.
    pub counts: Vec<u32>,
    /// Numbers of the voxels, ascending.
    keys: Vec<u64>,
    /// Voxels a metre.
    per_metre: f64,
}

impl Cloud {
    /// For each point whether a flag of its voxel is set; false where it has no voxel.
    pub fn of_points(&self, points: &[Vec3], flags: &[bool]) -> Vec<bool> {
        let voxel = |point| fixed_point(point, self.per_metre).and_then(|(key, _)| self.keys.binary_search(&key).ok());
        points.iter().map(|point| voxel(point).and_then(|voxel| flags.get(voxel).copied()).unwrap_or(false)).collect()
    }
}

/// Number of a point's voxel, and its position in fixed-point form; `None` beyond `REACH`.
fn fixed_point(point: &Vec3, per_metre: f64) -> Option<(u64, [u64; 3])> {
    let p = point * per_metre;
    if !(p.x.abs() < REACH && p.y.abs() < REACH && p.z.abs() < REACH) {
        return None;
    }
    let fixed = [p.x, p.y, p.z].map(|c| (c + SHIFT + TO_FIXED).to_bits());
    let [i, j, k] = fixed.map(|c| (c >> FRACTION) & ((1 << INDEX_BITS) - 1));
    Some(((i << (2 * INDEX_BITS)) | (j << INDEX_BITS) | k, fixed))
}

/// Where points come from, in parts that can be visited side by side.
pub trait PointSource: Sync {
    /// Number of parts.
    fn parts(&self) -> usize;
    /// Hands over every point of a range of parts.
    fn visit(&self, parts: Range<usize>, use_point: impl FnMut(&Vec3));
}

impl PointSource for [Vec3] {
    fn parts(&self) -> usize {
        self.len()
    }

    fn visit(&self, parts: Range<usize>, use_point: impl FnMut(&Vec3)) {
        self.get(parts).unwrap_or_default().iter().for_each(use_point);
    }
}

/// Means of points over voxels with side `size`. Points that aren't finite or lie beyond `REACH` voxels are left out.
pub fn voxel_grid(source: &(impl PointSource + ?Sized), size: f64, workers: &Workers) -> Result<Cloud> {
    check_size(size)?;
    let (n, threads) = (source.parts(), workers.threads());
    let mut grids: Vec<Grid> = (0..threads).map(|_| Grid::new(size)).collect();
    workers.for_parts(&mut grids, 1, |i, grid| {
        let parts = n * i / threads..n * (i + 1) / threads;
        grid.iter_mut().for_each(|grid| source.visit(parts.clone(), |point| grid.add(point)));
    });
    // one grid a thread, merged: sums of integers are the same in any order
    Ok(grids.into_iter().reduce(Grid::merged).map(Grid::means).unwrap_or_default())
}

fn check_size(size: f64) -> Result<()> {
    match size.is_finite() && size > 0.0 {
        true => Ok(()),
        false => Err(Error::Setting { name: "grid", bounds: "a positive number of metres", value: size }),
    }
}

/// Sums of the positions inside one voxel, in fractions of its side.
#[derive(Clone, Copy, Default)]
struct Sum {
    count: u64,
    x: u64,
    y: u64,
    z: u64,
}

impl Sum {
    fn add(&mut self, other: &Sum) {
        self.count += other.count;
        self.x += other.x;
        self.y += other.y;
        self.z += other.z;
    }
}

struct Grid {
    size: f64,
    per_metre: f64,
    voxels: HashMap<u64, Sum, BuildHasherDefault<KeyHasher>>,
    /// The voxel of the last point and its sum so far: pixels side by side mostly share it.
    open: (u64, Sum),
}

impl Grid {
    fn new(size: f64) -> Self {
        Self { size, per_metre: 1.0 / size, voxels: HashMap::default(), open: (0, Sum::default()) }
    }

    fn add(&mut self, point: &Vec3) {
        let Some((key, [x, y, z])) = fixed_point(point, self.per_metre) else { return };
        if key != self.open.0 {
            self.close();
            self.open = (key, Sum::default());
        }
        self.open.1.add(&Sum { count: 1, x: x % ONE, y: y % ONE, z: z % ONE });
    }

    fn close(&mut self) {
        let (key, sum) = self.open;
        if sum.count > 0 {
            self.voxels.entry(key).or_default().add(&sum);
        }
        self.open = (key, Sum::default());
    }

    fn merged(mut self, mut other: Grid) -> Self {
        self.close();
        other.close();
        other.voxels.iter().for_each(|(key, sum)| self.voxels.entry(*key).or_default().add(sum));
        self
    }

    fn means(mut self) -> Cloud {
        self.close();
        let mut voxels: Vec<(u64, Sum)> = self.voxels.into_iter().collect();
        voxels.sort_unstable_by_key(|(key, _)| *key);
        let coordinate = |index: u64, sum: u64, count: u64| {
            let within = sum as f64 / (count as f64 * ONE as f64);
            ((index % (1 << INDEX_BITS)) as f64 - SHIFT + within) * self.size
        };
        let mean = |(key, s): &(u64, Sum)| {
            Vec3::new(
                coordinate(key >> (2 * INDEX_BITS), s.x, s.count),
                coordinate(key >> INDEX_BITS, s.y, s.count),
                coordinate(*key, s.z, s.count),
            )
        };
        Cloud {
            points: voxels.iter().map(mean).collect(),
            counts: voxels.iter().map(|(_, s)| u32::try_from(s.count).unwrap_or(u32::MAX)).collect(),
            keys: voxels.iter().map(|(key, _)| *key).collect(),
            per_metre: self.per_metre,
        }
    }
}

/// Keys are numbers already: one multiplication spreads them over the table.
#[derive(Default)]
struct KeyHasher(u64);

impl Hasher for KeyHasher {
    fn finish(&self) -> u64 {
        self.0
    }

    fn write(&mut self, bytes: &[u8]) {
        bytes.iter().for_each(|byte| self.write_u64(u64::from(*byte)));
    }

    fn write_u64(&mut self, key: u64) {
        let mixed = (self.0 ^ key).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        self.0 = mixed ^ (mixed >> 32);
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::BTreeMap;

    /// The definition: voxels by floor, means by adding up.
    fn slow(points: &[Vec3], size: f64) -> Vec<(Vec3, u32)> {
        let mut voxels: BTreeMap<[i64; 3], (Vec3, u32)> = BTreeMap::new();
        for p in points {
            let key = [p.x, p.y, p.z].map(|c| (c * (1.0 / size)).floor() as i64);
            let voxel = voxels.entry(key).or_insert((Vec3::zeros(), 0));
            *voxel = (voxel.0 + p, voxel.1 + 1);
        }
        voxels.into_values().map(|(sum, count)| (sum / f64::from(count), count)).collect()
    }

    fn cloud() -> impl Strategy<Value = Vec<Vec3>> {
        prop::collection::vec([-3.0..3.0f64, -3.0..3.0, 0.1..3.0].prop_map(|[x, y, z]| Vec3::new(x, y, z)), 0..200)
    }

    proptest! {
        #[test]
        fn means_are_those_of_the_definition(points in cloud(), size in 0.01..2.0f64) {
            let grid = voxel_grid(points.as_slice(), size, &Workers::new(1)).unwrap();
            let expected = slow(&points, size);
            prop_assert_eq!(grid.counts, expected.iter().map(|(_, n)| *n).collect::<Vec<_>>());
            for (mean, (exact, _)) in grid.points.iter().zip(&expected) {
                prop_assert!((mean - exact).norm() < 1e-9 * size.max(1.0));
            }
        }

        #[test]
        fn order_and_threads_change_no_bit(points in cloud(), threads in 1..4usize) {
            let grid = voxel_grid(points.as_slice(), 0.3, &Workers::new(1)).unwrap();
            let reversed: Vec<Vec3> = points.iter().rev().copied().collect();
            prop_assert_eq!(voxel_grid(reversed.as_slice(), 0.3, &Workers::new(threads)).unwrap(), grid);
        }

        #[test]
        fn any_number_is_survived(numbers in prop::collection::vec(prop::num::f64::ANY, 0..60), size in prop::num::f64::ANY) {
            let points: Vec<Vec3> = numbers.chunks_exact(3).map(Vec3::from_column_slice).collect();
            if let Ok(grid) = voxel_grid(points.as_slice(), size, &Workers::new(1)) {
                prop_assert!(grid.points.iter().all(|p| p.iter().all(|c| c.is_finite())));
            }
        }
    }

    #[test]
    fn what_is_too_far_or_no_number_is_left_out() -> Result<()> {
        let far = [Vec3::new(f64::NAN, 0.0, 0.0), Vec3::new(1e300, 0.0, 0.0), Vec3::new(0.0, f64::NEG_INFINITY, 1.0)];
        assert!(voxel_grid(far.as_slice(), 0.05, &Workers::new(1))?.points.is_empty());
        assert!(voxel_grid(far.as_slice(), 0.0, &Workers::new(1)).is_err());
        Ok(())
    }
}
