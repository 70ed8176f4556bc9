//! Correlation of the residuals between neighbouring tiles: by how much fewer independent tiles there are.

use crate::geometry::surface::Part;
use crate::surface_fit::joint::labels::Labels;
use crate::surface_fit::joint::predict::Sight;
use crate::surface_fit::joint::readings::Readings;

/// Reach of the correlation, tiles.
const REACH: i64 = 6;
/// Fewest tiles from which it is told.
const FEWEST: usize = 60;
/// A correlation counts beyond this many of its standard errors.
const SIGNIFICANT: f64 = 2.0;
/// Largest factor.
const LARGEST: f64 = 80.0;

/// f of a part: 1 + the sum of its residuals' significant correlations within reach, times their variance where that
/// exceeds what is stated.
pub fn correlation_factor(readings: &Readings, sights: &[Option<Sight>], labels: &Labels, part: Part) -> f64 {
    let columns = readings.patches.columns as i64;
    let rows = readings.patches.list.iter().map(|p| i64::from(p.tile.1)).max().map_or(0, |row| row + 1);
    let mut grid = vec![f64::NAN; (columns * rows).max(0) as usize];
    let mut places = Vec::new();
    for (i, sight) in sights.iter().enumerate() {
        let Some(sight) = sight.filter(|s| s.at.part == part && labels.wall[i] > 0.7) else { continue };
        let (column, row) = readings.patches.list[i].tile;
        let value = (sight.residual / labels.variance[i].sqrt()).clamp(-4.0, 4.0);
        grid[row as usize * columns as usize + column as usize] = value;
        places.push((i64::from(column), i64::from(row), value));
    }
    if places.len() < FEWEST {
        return 1.0;
    }
    let variance = (places.iter().map(|p| p.2 * p.2).sum::<f64>() / places.len() as f64).max(1e-9);
    let mut total = 1.0;
    for (du, dv) in offsets() {
        let (mut sum, mut count) = (0.0, 0.0);
        for &(column, row, value) in &places {
            let (c, r) = (column + du, row + dv);
            if c >= 0 && c < columns && r < rows {
                let other = grid[(r * columns + c) as usize];
                if !other.is_nan() {
                    sum += value * other;
                    count += 1.0;
                }
            }
        }
        let correlation = sum / f64::max(count, 1.0) / variance;
        if count > 20.0 && correlation > SIGNIFICANT / f64::sqrt(2.0 * count) {
            total += 2.0 * correlation;
        }
    }
    (total * variance.max(1.0)).clamp(1.0, LARGEST)
}

/// Half of the offsets within reach: the other half has the same correlations.
fn offsets() -> impl Iterator<Item = (i64, i64)> {
    (0..=REACH)
        .flat_map(|dv| (-REACH..=REACH).map(move |du| (du, dv)))
        .filter(|(du, dv)| du * du + dv * dv <= REACH * REACH && (*dv > 0 || *du > 0))
}
