//! Why to believe the six steps' axis: what must hold on walls of revolution, measured on the walls found.

use crate::base::refusal::Refusal;
use crate::geometry::view::View;
use crate::shape_tensor::candidates::Candidate;
use crate::stats::robust::median;
use crate::{SiloPose, Vec3};

/// What was measured.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Evidence {
    /// Points of the voxel grid.
    pub points: usize,
    /// Candidates of step 3.
    pub candidates: usize,
    /// Those of them that agree with the axis direction.
    pub walls: usize,
    /// Spread of E1 about the axis: 1 where walls are seen all around, 0 where they all face the same way.
    pub around: f64,
    /// Spread of E1 along the axis over that: 0 on cylinder and cone.
    pub along: f64,
    /// Sine of the angle at which the normals pass the axis, median.
    pub miss: f64,
    /// Curvature over that of the circle about the axis, k1 ρ / cos α, median: 1 seen from inside, -1 from outside.
    pub turn: f64,
    /// The same for the other curvature, k2 ρ: 0 on cylinder and cone, 1 on a sphere.
    pub bend: f64,
    /// Share of the pixels behind the wall.
    pub behind: f64,
}

/// A wall in the silo frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlacedWall {
    /// The point.
    pub p: Vec3,
    /// Its normal.
    pub normal: Vec3,
    /// Its direction E1.
    pub e1: Vec3,
    /// Its curvatures across and along the generatrix.
    pub curvatures: [f64; 2],
}

impl PlacedWall {
    /// Distance from the axis.
    pub fn rho(&self) -> f64 {
        self.p.x.hypot(self.p.y)
    }

    /// Angle of the wall to the axis by its normal: 0 on the cylinder, atan m on the cone.
    pub fn angle(&self) -> f64 {
        let outwards = (self.normal.x * self.p.x + self.normal.y * self.p.y) / self.rho().max(1e-12);
        (self.normal.z / outwards).atan()
    }
}

/// Places the candidates kept by step 4.
pub fn placed_walls(kept: &[Candidate], points: &[Vec3], normals: &[Vec3], pose: &SiloPose) -> Vec<PlacedWall> {
    let turn = pose.rotation();
    let place = |c: &Candidate| PlacedWall {
        p: pose.to_silo(&points[c.index]),
        normal: turn * normals[c.index],
        e1: turn * c.e1,
        curvatures: [c.bent, c.straight],
    };
    kept.iter().map(place).collect()
}

/// Fewest walls that are evidence of anything.
const MIN_WALLS: usize = 30;
/// Least share of the walls among the candidates, and among all points.
const MIN_KEPT_FRACTION: f64 = 0.25;
const MIN_FRACTION: f64 = 0.05;
/// Least spread of E1 about the axis: walls over an arc of some 30°.
const MIN_AROUND: f64 = 0.06;
/// Range of `miss`.
const MISS: std::ops::Range<f64> = 0.0..0.06;
/// Range of |`turn`|.
const TURN: std::ops::Range<f64> = 0.8..1.25;
/// Largest `along` and |`bend`|.
const MAX_ALONG: f64 = 0.12;
const MAX_BEND: f64 = 0.06;
/// Largest share of pixels behind the wall.
const MAX_BEHIND: f64 = 0.02;

impl Evidence {
    /// Measures it; `counts` are those of points and candidates, `spread` is that of step 4.
    pub fn of(walls: &[PlacedWall], counts: [usize; 2], spread: [f64; 3], behind: f64) -> Self {
        let median_of = |f: &dyn Fn(&PlacedWall) -> f64| median(walls.iter().map(f).collect()).unwrap_or(f64::NAN);
        let miss = |w: &PlacedWall| {
            let (p, n) = (w.p.xy(), w.normal.xy());
            (p.x * n.y - p.y * n.x).abs() / (p.norm() * n.norm()).max(1e-12)
        };
        Self {
            points: counts[0],
            candidates: counts[1],
            walls: walls.len(),
            around: spread[1] / spread[2],
            along: spread[0] / spread[1],
            miss: median_of(&miss),
            turn: median_of(&|w| w.curvatures[0] * w.rho() / w.angle().cos()),
            bend: median_of(&|w| w.curvatures[1] * w.rho()),
            behind,
        }
    }

    /// Whether it is a wall of revolution.
    ///
    /// The limits lie between what simulated silos and what walls, corners, shafts, spheres and heaps of feed give:
    /// docs/design/choices-shape-tensor.md.
    pub fn judge(&self, view: View) -> Result<(), Refusal> {
        let (walls, kept) = (self.walls as f64, MIN_KEPT_FRACTION * self.candidates as f64);
        let few = self.walls < MIN_WALLS || walls < kept || walls < MIN_FRACTION * self.points as f64;
        let bent = !(self.along < MAX_ALONG && self.bend.abs() < MAX_BEND);
        match () {
            () if few || !MISS.contains(&self.miss) => Err(Refusal::NoWall),
            () if bent => Err(Refusal::Bent),
            () if !(self.around > MIN_AROUND && TURN.contains(&self.turn.abs())) => Err(Refusal::Flat),
            () if view == View::Inside && self.behind > MAX_BEHIND => Err(Refusal::BehindWall),
            () => Ok(()),
        }
    }
}
