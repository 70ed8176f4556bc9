//! What an empty vessel may still hide: feed where the floor is out of view.

use super::grid::Grid;
use super::under::Under;
use super::volume::Kind;
use crate::geometry::surface::FEED_SLOPE;

/// Steepest rise of feed at rest on a floor.
const RISE: f64 = 1.0 / FEED_SLOPE;

/// Most that can lie on the floor that no cell shows, cubic metres, where nothing lies on the floor that is seen.
///
/// On a floor that falls less than feed at rest, feed that begins behind a bare cell may rise from there as feed does. From
/// a steeper one it has slid down, and lies as high as the lowest bare cell at most.
pub fn hidden(grid: &Grid, kinds: &[Kind], under: &Under<'_>) -> f64 {
    let radius = under.vessel.radius;
    let place = |i: usize| {
        let [x, y] = grid.middle(i);
        [x, y, under.z([x, y], x.hypot(y))]
    };
    let unseen = |&i: &usize| kinds[i] == Kind::Unseen && grid.middle(i)[0].hypot(grid.middle(i)[1]) < radius;
    let edge = |i: &usize| matches!(kinds[*i], Kind::Bare | Kind::Rim) && grid.around(*i).any(|j| unseen(&j));
    let edge: Vec<[f64; 3]> = (0..grid.count()).filter(edge).map(place).collect();
    let thickness = |[x, y, floor]: [f64; 3]| {
        let [fall_x, fall_y] = under.slopes(x, y);
        let rise = if fall_x.hypot(fall_y) < RISE { RISE } else { 0.0 };
        let top = edge.iter().map(|[u, v, z]| z - rise * (x - u).hypot(y - v)).reduce(f64::max);
        top.map_or(0.0, |top| (floor - top).max(0.0))
    };
    (0..grid.count()).filter(unseen).map(place).map(thickness).sum::<f64>() * grid.cell().powi(2)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::vessel::Vessel;

    const CELL: f64 = 0.05;

    /// A vessel of radius 1 m on a cone of a height, of which the cells with x below a place are unseen.
    fn hidden_beyond(place: f64, height: f64) -> f64 {
        let (radius, top, outlet_radius, outlet_length) = (1.0, 0.0, 0.0, 0.0);
        let (cylinder_bottom, apex, ovality) = (3.0, 3.0 + height, [0.0; 2]);
        let vessel = Vessel { radius, cylinder_bottom, apex, top, outlet_radius, outlet_length, ovality };
        let grid = Grid { centre: [0.0; 2], reach: 1.0, side: (2.0 / CELL) as usize };
        let kind = |i: usize| if grid.middle(i)[0] < place { Kind::Unseen } else { Kind::Bare };
        let kinds: Vec<Kind> = (0..grid.count()).map(kind).collect();
        hidden(&grid, &kinds, &Under { vessel: &vessel, map: None })
    }

    #[test]
    fn nothing_hides_on_a_floor_that_is_seen() {
        for height in [0.0, 0.3, 2.0] {
            assert_eq!(hidden_beyond(-1.0, height), 0.0);
        }
        assert_eq!(hidden_beyond(-0.5, 2.0), 0.0); // the floor lies higher there than what is seen
    }

    #[test]
    fn feed_fills_a_steep_cone_as_high_as_the_lowest_bare_place() {
        let lowest: f64 = 0.5 + 0.5 * CELL; // middle of the bare cell that is nearest to the axis
        let volume = std::f64::consts::PI * lowest.powi(2) * (2.0 * lowest) / 3.0;
        let found = hidden_beyond(0.5, 2.0);
        assert!((found - volume).abs() < 0.03 * volume, "{found} {volume}");
    }

    #[test]
    fn feed_rises_by_its_repose_on_a_flat_floor() {
        // over the half disc the mean of the distance from the straight edge is 4 R / 3 pi
        let volume = RISE * 4.0 / (3.0 * std::f64::consts::PI) * std::f64::consts::FRAC_PI_2;
        let found = hidden_beyond(0.0, 0.0);
        assert!((found - volume).abs() < 0.1 * volume, "{found} {volume}");
    }
}
