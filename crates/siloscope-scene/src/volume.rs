//! How much feed there is, by quadrature.

use crate::feed::Feed;
use crate::silo::Silo;
use std::f64::consts::TAU;

/// The feed inside cylinder and cone (above the vertex's level surface of the cone; the outlet pipe is not counted).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Content {
    /// Cubic metres.
    pub volume: f64,
    /// Area of the feed surface seen from above, square metres.
    pub area: f64,
    /// Mean height of the feed surface over the vertex, by area seen from above; NaN where there is no feed.
    pub mean_height: f64,
    /// Highest feed point over the vertex.
    pub max_height: f64,
    /// Lowest point of the feed surface over the vertex, to about a millimetre.
    pub min_height: f64,
}

/// Volume, covered area, area times height, and the lowest height, over one spoke or the whole silo.
#[derive(Debug, Clone, Copy)]
struct Sums {
    volume: f64,
    area: f64,
    moment: f64,
    low: f64,
}

const NOTHING: Sums = Sums { volume: 0.0, area: 0.0, moment: 0.0, low: f64::INFINITY };

impl Sums {
    fn plus(self, other: Sums) -> Sums {
        Sums {
            volume: self.volume + other.volume,
            area: self.area + other.area,
            moment: self.moment + other.moment,
            low: self.low.min(other.low),
        }
    }

    fn times(self, factor: f64) -> Sums {
        Sums { volume: self.volume * factor, area: self.area * factor, moment: self.moment * factor, ..self }
    }
}

/// Content by the trapezoid rule over the angle, spokes doubled until the volume stands to 1e-7 of itself.
pub fn content(feed: &Feed) -> Content {
    let mut spokes = 32;
    let mut sums = around(feed, spokes, 0.0);
    while spokes < 1 << 12 {
        let between = around(feed, spokes, 0.5);
        let finer = sums.plus(between).times(0.5);
        let change = (finer.volume - sums.volume).abs();
        (sums, spokes) = (finer, 2 * spokes);
        if change <= 1e-7 * sums.volume {
            break;
        }
    }
    Content {
        volume: sums.volume,
        area: sums.area,
        mean_height: sums.moment / sums.area,
        max_height: feed.level * feed.silo.height(),
        min_height: sums.low,
    }
}

fn around(feed: &Feed, spokes: usize, shift: f64) -> Sums {
    let angle = |i: usize| TAU * (i as f64 + shift) / spokes as f64;
    (0..spokes).map(|i| along(feed, angle(i))).fold(NOTHING, Sums::plus).times(TAU / spokes as f64)
}

/// Sums along one spoke: the feed's edges are found first, then each piece is smooth and gets Gauss's rule.
fn along(feed: &Feed, angle: f64) -> Sums {
    const PIECES: usize = 64;
    let silo = &feed.silo;
    let (sin, cos) = angle.sin_cos();
    let surface = |r: f64| feed.height(r * cos, r * sin);
    let thickness = |r: f64| surface(r) - silo.floor_height(r, (cos, sin));
    let at = |i: usize| silo.radius * i as f64 / PIECES as f64;
    let mut sums = NOTHING;
    for i in 0..PIECES {
        let (a, b) = (at(i), at(i + 1));
        let (from, to) = match (thickness(a) > 0.0, thickness(b) > 0.0) {
            (true, true) => (a, b),
            (true, false) => (a, edge(thickness, a, b)),
            (false, true) => (edge(thickness, b, a), b),
            (false, false) => continue,
        };
        sums = sums.plus(piece(from, to, surface, thickness));
    }
    sums.volume += in_courses(silo, surface);
    sums
}

/// Volume along one spoke between the silo's radius and that of its courses; negative where they are narrower.
fn in_courses(silo: &Silo, surface: impl Fn(f64) -> f64) -> f64 {
    let mut upper = 0.0;
    let ring = |&[lower, radius]: &[f64; 2]| {
        let (high, low) = (silo.height() - upper, silo.height() - lower);
        upper = lower;
        piece(silo.radius, radius, |_| 0.0, |r| surface(r).min(high).max(low) - low).volume
    };
    silo.courses.iter().map(ring).sum()
}

/// The place between a covered and an uncovered radius where the feed ends, by bisection.
fn edge(thickness: impl Fn(f64) -> f64, mut covered: f64, mut bare: f64) -> f64 {
    for _ in 0..52 {
        let middle = 0.5 * (covered + bare);
        if thickness(middle) > 0.0 { covered = middle } else { bare = middle }
    }
    covered
}

/// Gauss's rule with 5 points over a smooth piece of a spoke.
fn piece(from: f64, to: f64, surface: impl Fn(f64) -> f64, thickness: impl Fn(f64) -> f64) -> Sums {
    const NODES: [f64; 5] =
        [-0.906_179_845_938_664, -0.538_469_310_105_683_1, 0.0, 0.538_469_310_105_683_1, 0.906_179_845_938_664];
    const WEIGHTS: [f64; 5] = [
        0.236_926_885_056_189_1,
        0.478_628_670_499_366_5,
        0.568_888_888_888_888_9,
        0.478_628_670_499_366_5,
        0.236_926_885_056_189_1,
    ];
    let (middle, half) = (0.5 * (from + to), 0.5 * (to - from));
    let mut sums = Sums { low: surface(from).min(surface(to)), ..NOTHING };
    for (node, weight) in NODES.iter().zip(WEIGHTS) {
        let r = middle + half * node;
        let ring = weight * half * r;
        sums.volume += ring * thickness(r);
        sums.area += ring;
        sums.moment += ring * surface(r);
    }
    sums
}
