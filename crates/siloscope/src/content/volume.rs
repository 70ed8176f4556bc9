//! The volume between the silo's floor and the surface, with all it depends on.
//!
//! V = ∫∫ (floor(x, y) - z(x, y))₊ dA, in polar coordinates: the trapezoid rule over the angle, which is as good as exact for
//! a smooth periodic function, and along each spoke Gauss's rule on pieces that begin and end where the surface meets the
//! floor. The silo's round wall is the spokes' end, so no cell has to be cut. Over a floor that is known as a map, cells
//! that show it bare count with their own thickness and its sign: thin feed that none of them proves adds up, noise does not.

use super::cells::Cell;
use super::detail;
use super::fit::Surface;
use super::under::Under;
use crate::geometry::vessel::Shells;
use nalgebra::DVector;
use std::f64::consts::TAU;

/// Spokes, and pieces of a spoke before it is cut.
const SPOKES: usize = 72;
const PIECES: usize = 16;
/// Gauss's rule with two points on [0, 1], exact to the third power.
const GAUSS: [f64; 2] = [0.211_324_865_405_187_1, 0.788_675_134_594_812_9];

/// Kind of a cell as far as the volume is concerned.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Nothing seen.
    Unseen,
    /// Content seen.
    Feed,
    /// Seen, and the content's rim runs through it or close by.
    Rim,
    /// The cone or floor seen: nothing lies there.
    Bare,
    /// Something seen that is not the content's surface.
    Clutter,
}

/// Volume, areas, heights and derivatives.
#[derive(Debug, Clone)]
pub struct Volume {
    /// Cubic metres.
    pub volume: f64,
    /// Area of the surface seen from above.
    pub area: f64,
    /// The part of it over cells that show it.
    pub seen: f64,
    /// ∫ z dA over the surface.
    pub moment: f64,
    /// Least and greatest z of the surface.
    pub extremes: [f64; 2],
    /// Mean z where the surface meets the wall or the cone, each angle counting the same.
    pub at_wall: Option<f64>,
    /// Share of the angles at which the surface reaches the cylinder's wall.
    pub wall_share: f64,
    /// Greatest distance of the content's rim from the axis.
    pub reach: f64,
    /// ∫ φ dA of the trend's functions over the surface.
    pub functions: DVector<f64>,
    /// Weights of the cells' detail in ∫ z dA.
    pub cells: Vec<f64>,
    /// Derivatives by the geometry at a fixed surface.
    pub geometry: Shells,
    /// Weights of the bare cells' own heights in ∫ z dA.
    pub bare: Vec<f64>,
    /// What a standard deviation of the floor that is common to all of it does to the volume.
    pub floor_std: f64,
    /// Area over which content or bare floor counts.
    pub counted: f64,
}

/// Integrates the content.
pub fn integrate(surface: &Surface, under: &Under<'_>, kinds: &[Kind], cells: &[Cell]) -> Volume {
    let functions = surface.basis.functions();
    let mut sums = Volume {
        volume: 0.0,
        area: 0.0,
        seen: 0.0,
        moment: 0.0,
        extremes: [f64::INFINITY, f64::NEG_INFINITY],
        at_wall: None,
        wall_share: 0.0,
        reach: 0.0,
        functions: DVector::zeros(functions),
        cells: vec![0.0; surface.grid.count()],
        geometry: Shells::default(),
        bare: vec![0.0; surface.grid.count()],
        floor_std: 0.0,
        counted: 0.0,
    };
    let mut rims = (0.0, 0.0);
    for spoke in 0..SPOKES {
        let angle = TAU * (spoke as f64 + 0.5) / SPOKES as f64;
        let spoke = Spoke { surface, under, kinds, cells, direction: [angle.cos(), angle.sin()] };
        if let Some(rim) = spoke.add(&mut sums) {
            rims = (rims.0 + rim, rims.1 + 1.0);
        }
    }
    sums.at_wall = (rims.1 > 0.0).then_some(rims.0 / rims.1);
    sums.wall_share /= SPOKES as f64;
    sums
}

/// One spoke from the axis to the wall.
struct Spoke<'a> {
    surface: &'a Surface,
    under: &'a Under<'a>,
    kinds: &'a [Kind],
    cells: &'a [Cell],
    direction: [f64; 2],
}

impl Spoke<'_> {
    fn place(&self, r: f64) -> [f64; 2] {
        [r * self.direction[0], r * self.direction[1]]
    }

    fn kind(&self, r: f64) -> Kind {
        let [x, y] = self.place(r);
        let index = self.surface.grid.index(x, y);
        index.and_then(|i| self.kinds.get(i)).copied().unwrap_or(Kind::Unseen)
    }

    /// Thickness of the content; negative where the surface would lie below the floor.
    fn thickness(&self, r: f64) -> f64 {
        let [x, y] = self.place(r);
        self.under.z([x, y], r) - self.surface.height(x, y)
    }

    /// Adds the spoke's pieces; gives z of the surface at its outer rim.
    fn add(&self, sums: &mut Volume) -> Option<f64> {
        let mut rim = None;
        let mut inner = (0.0, self.thickness(0.0));
        for piece in self.ends() {
            let outer = (piece, self.thickness(piece));
            if self.kind(0.5 * (inner.0 + piece)) == Kind::Bare {
                self.bare(inner.0, piece, sums);
            } else if let Some((from, to)) = self.covered(inner, outer) {
                self.piece(from, to, sums);
                rim = Some(to);
            }
            inner = outer;
        }
        sums.reach = sums.reach.max(rim?);
        let at_wall = rim? >= self.under.vessel.radius * (1.0 - 1e-9);
        if at_wall {
            self.wall(sums);
        }
        let [x, y] = self.place(rim?);
        Some(self.surface.height(x, y))
    }

    /// Outer ends of the pieces: evenly spread, and the outlet's rim where there is one.
    fn ends(&self) -> impl Iterator<Item = f64> {
        let (radius, outlet) = (self.under.vessel.radius, self.under.vessel.outlet_radius);
        (1..=PIECES).flat_map(move |i| {
            let end = radius * i as f64 / PIECES as f64;
            let begin = radius * (i - 1) as f64 / PIECES as f64;
            [(outlet > begin && outlet < end).then_some(outlet), Some(end)].into_iter().flatten()
        })
    }

    /// The part of a piece that has content: up to or from the place where the surface meets the cone.
    fn covered(&self, inner: (f64, f64), outer: (f64, f64)) -> Option<(f64, f64)> {
        match (inner.1 > 0.0, outer.1 > 0.0) {
            (true, true) => Some((inner.0, outer.0)),
            (true, false) => Some((inner.0, self.meeting(inner, outer))),
            (false, true) => Some((self.meeting(outer, inner), outer.0)),
            (false, false) => None,
        }
    }

    /// Where the surface meets the floor between a covered and a bare place, by the Illinois rule.
    fn meeting(&self, mut covered: (f64, f64), mut bare: (f64, f64)) -> f64 {
        let mut last = 0;
        let mut r = covered.0;
        for _ in 0..30 {
            r = (covered.0 * bare.1 - bare.0 * covered.1) / (bare.1 - covered.1);
            let thickness = self.thickness(r);
            if thickness > 0.0 {
                covered = (r, thickness);
                bare.1 *= if last == 1 { 0.5 } else { 1.0 };
                last = 1;
            } else {
                bare = (r, thickness);
                covered.1 *= if last == 2 { 0.5 } else { 1.0 };
                last = 2;
            }
            if thickness.abs() < 1e-9 || (covered.0 - bare.0).abs() < 1e-9 {
                break;
            }
        }
        r
    }

    fn piece(&self, from: f64, to: f64, sums: &mut Volume) {
        let surface = self.surface;
        for node in GAUSS {
            let r = from + node * (to - from);
            let [x, y] = self.place(r);
            let ring = self.ring(from, to, r);
            let row = surface.row(x, y);
            let near = detail::weights(&surface.grid, x, y);
            let extra: f64 = near.iter().map(|&(i, w)| w * surface.detail[i]).sum();
            let z = surface.datum + surface.trend.height(&row) * surface.grid.reach + extra;
            sums.volume += ring * (self.under.z([x, y], r) - z);
            sums.area += ring;
            sums.moment += ring * z;
            sums.seen += if matches!(self.kind(r), Kind::Feed | Kind::Rim) { ring } else { 0.0 };
            sums.extremes = [sums.extremes[0].min(z), sums.extremes[1].max(z)];
            row.iter().for_each(|(i, value)| sums.functions[i] += ring * value * surface.grid.reach);
            near.iter().for_each(|&(i, w)| sums.cells[i] += ring * w);
            self.floor_moves([x, y], r, ring, sums);
        }
    }

    /// A Gauss node's area.
    fn ring(&self, from: f64, to: f64, r: f64) -> f64 {
        0.5 * (to - from) * r * TAU / SPOKES as f64 * self.under.vessel.stretch()
    }

    /// Adds the cells' own heights over a piece of mapped floor that is seen bare.
    fn bare(&self, from: f64, to: f64, sums: &mut Volume) {
        let Some(map) = self.under.map else { return };
        for node in GAUSS {
            let r = from + node * (to - from);
            let [x, y] = self.place(r);
            let Some(index) = self.surface.grid.index(x, y) else { continue };
            let Some(cell) = self.cells.get(index).filter(|cell| cell.seen()) else { continue };
            let ring = self.ring(from, to, r);
            let [cx, cy, z] = cell.mean;
            sums.volume += ring * (map.z(cx, cy) - z);
            sums.bare[index] += ring;
            self.floor_moves([x, y], r, ring, sums);
        }
    }

    fn floor_moves(&self, [x, y]: [f64; 2], r: f64, ring: f64, sums: &mut Volume) {
        let by = self.under.derivatives(r);
        sums.geometry.radius += ring * by.radius;
        sums.geometry.cylinder_bottom += ring * by.cylinder_bottom;
        sums.geometry.apex += ring * by.apex;
        sums.floor_std += ring * self.under.std(x, y);
        sums.counted += ring;
    }

    /// A wider silo has a ring more of content where the surface reaches its wall.
    fn wall(&self, sums: &mut Volume) {
        sums.wall_share += 1.0;
        let radius = self.under.vessel.radius;
        sums.geometry.radius += radius * TAU / SPOKES as f64 * self.thickness(radius);
    }
}
