//! Deviations from the trend: as the cells have them where they are seen, dying away smoothly where not.

use super::grid::Grid;

/// Distance in cells over which a deviation dies away in unseen cells.
const REACH: f64 = 3.0;
/// Rounds of over-relaxation, each of which leaves less than half of the error.
const ROUNDS: usize = 24;
const OVER: f64 = 1.5;

/// Extends the known deviations by the screened Laplace equation `(4 + 1/reach²) d = Σ neighbours`.
pub fn fill(grid: &Grid, known: &[Option<f64>]) -> Vec<f64> {
    let mut d: Vec<f64> = known.iter().map(|k| k.unwrap_or(0.0)).collect();
    let free: Vec<usize> = (0..grid.count()).filter(|&i| known[i].is_none()).collect();
    relax(grid, &free, &mut d, |_| 0.0);
    d
}

/// How much each known deviation weighs in `Σ weights · fill(known)`: the transpose of `fill`.
pub fn gather(grid: &Grid, known: &[bool], weights: &[f64]) -> Vec<f64> {
    let free: Vec<usize> = (0..grid.count()).filter(|&i| !known[i]).collect();
    let mut carried = vec![0.0; grid.count()];
    relax(grid, &free, &mut carried, |i| weights[i]);
    let own = |i: usize| weights[i] + grid.beside(i).filter(|&j| !known[j]).map(|j| carried[j]).sum::<f64>();
    (0..grid.count()).map(|i| if known[i] { own(i) } else { 0.0 }).collect()
}

/// Sweeps of successive over-relaxation, forwards and backwards in turn, over the free cells.
fn relax(grid: &Grid, free: &[usize], d: &mut [f64], source: impl Fn(usize) -> f64) {
    let screen = 1.0 / (REACH * REACH);
    let step = |i: usize, d: &mut [f64]| {
        let (sum, beside) = grid.beside(i).fold((0.0, 0.0), |(sum, n), j| (sum + d[j], n + 1.0));
        d[i] += OVER * ((sum + source(i)) / (beside + screen) - d[i]);
    };
    for round in 0..ROUNDS {
        if round % 2 == 0 {
            free.iter().for_each(|&i| step(i, d));
        } else {
            free.iter().rev().for_each(|&i| step(i, d));
        }
    }
}

/// Weights of the four cells between whose middles a place lies; at the edge the nearest ones.
pub fn weights(grid: &Grid, x: f64, y: f64) -> [(usize, f64); 4] {
    let cell = grid.cell();
    let last = (grid.side - 1) as f64;
    let s = ((x - grid.centre[0] + grid.reach) / cell - 0.5).clamp(0.0, last);
    let t = ((y - grid.centre[1] + grid.reach) / cell - 0.5).clamp(0.0, last);
    let (i, j) = (s.min(last - 1.0).floor(), t.min(last - 1.0).floor());
    let (s, t, at) = (s - i, t - j, j as usize * grid.side + i as usize);
    [(at, (1.0 - s) * (1.0 - t)), (at + 1, s * (1.0 - t)), (at + grid.side, (1.0 - s) * t), (at + grid.side + 1, s * t)]
}

/// Bilinear value between the cells' middles.
pub fn between(grid: &Grid, values: &[f64], x: f64, y: f64) -> f64 {
    weights(grid, x, y).iter().map(|&(i, w)| w * values.get(i).copied().unwrap_or(0.0)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    const GRID: Grid = Grid { centre: [0.1, -0.2], reach: 1.0, side: 16 };

    #[test]
    fn a_deviation_dies_away_from_where_it_is_known() {
        let known: Vec<_> = (0..GRID.count()).map(|i| (i % 16 < 4).then_some(0.05)).collect();
        let filled = fill(&GRID, &known);
        let row: Vec<f64> = (0..16).map(|i| filled[8 * 16 + i]).collect();
        assert!(row.windows(2).all(|w| w[1] <= w[0] + 1e-12), "{row:?}");
        assert!(row[4] > 0.03 && row[15] < 0.01, "{row:?}");
    }

    #[test]
    fn gathering_is_the_transpose_of_filling() {
        let known: Vec<bool> = (0..GRID.count()).map(|i| (i * 7) % 5 < 2 || i % 16 < 3).collect();
        let weights: Vec<f64> = (0..GRID.count()).map(|i| (i as f64).sin()).collect();
        let values: Vec<f64> = (0..GRID.count()).map(|i| (i as f64 * 0.3).cos()).collect();
        let filled = fill(&GRID, &known.iter().zip(&values).map(|(k, v)| k.then_some(*v)).collect::<Vec<_>>());
        let forwards: f64 = filled.iter().zip(&weights).map(|(d, w)| d * w).sum();
        let back: f64 = gather(&GRID, &known, &weights).iter().zip(&values).map(|(g, v)| g * v).sum();
        assert!((forwards - back).abs() < 1e-9 * (1.0 + forwards.abs()), "{forwards} {back}");
    }

    #[test]
    fn between_middles_it_is_bilinear() {
        let values: Vec<f64> =
            (0..GRID.count()).map(|i| GRID.middle(i)).map(|[x, y]| 1.0 + 2.0 * x - 3.0 * y).collect();
        for (x, y) in [(0.1, -0.2), (0.73, 0.41), (-0.6, -0.9)] {
            assert!((between(&GRID, &values, x, y) - (1.0 + 2.0 * x - 3.0 * y)).abs() < 1e-12);
        }
    }
}
