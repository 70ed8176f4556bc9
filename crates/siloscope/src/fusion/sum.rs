//! Frames added up: what comes back in every frame counts once, what is new in each of them counts as often.
//!
//! A share's score has two parts: the sensor's noise, new in every frame, and what the wall and the lens add to it, which
//! comes back where frames show the same. Of n frames that show the same, each then counts 1/(s + n (1 − s)), s the
//! noise's fraction of the score's variance: n frames of pure noise count n times, n frames without noise once.

use crate::fusion::placed::Placed;
use crate::surface_fit::frame_factor::{Kind, Share};
use crate::surface_fit::joint::parameters::SIZE;
use crate::surface_fit::joint::system::{PartSum, Quadratic};
use nalgebra::{DMatrix, DVector};

/// Shares added up about a state, by kind.
#[derive(Debug, Clone, Default)]
pub struct Sum {
    /// The sums; none of a kind that no frame has.
    pub shares: Vec<Share>,
}

impl Sum {
    /// Adds a share, so many times.
    pub fn add(&mut self, share: &Share, weight: f64) {
        if weight <= 0.0 {
            return;
        }
        match self.shares.iter_mut().find(|sum| sum.kind == share.kind) {
            Some(sum) => {
                sum.information.iter_mut().zip(&share.information).for_each(|(sum, v)| *sum += weight * v);
                sum.gradient.iter_mut().zip(&share.gradient).for_each(|(sum, v)| *sum += weight * v);
            }
            None => self.shares.push(Share {
                information: share.information.iter().map(|v| weight * v).collect(),
                gradient: share.gradient.iter().map(|v| weight * v).collect(),
                ..share.clone()
            }),
        }
    }

    /// Over all parameters.
    pub fn quadratic(&self) -> Quadratic {
        let (mut information, mut gradient) = (DMatrix::zeros(SIZE, SIZE), DVector::zeros(SIZE));
        for share in &self.shares {
            let columns = share.kind.columns();
            for (r, &row) in columns.iter().enumerate() {
                gradient[row] += share.gradient[r];
                for (c, &column) in columns.iter().enumerate() {
                    information[(row, column)] += share.value(r, c);
                }
            }
        }
        Quadratic { information, gradient, parts: [PartSum::default(), PartSum::default()] }
    }
}

/// A share's kind, the sensor's fraction of its score, how much it shows, and for how many frames it stands.
#[derive(Debug, Clone, Copy)]
pub struct Shown {
    /// The kind.
    pub kind: Kind,
    /// The sensor's fraction of the score's variance.
    pub sensor_fraction: f64,
    /// Fraction of a frame's tiles.
    pub seen: f64,
    /// Frames, weighed.
    pub frames: f64,
}

impl Shown {
    fn of(share: &Share, frames: f64) -> Self {
        Self { kind: share.kind, sensor_fraction: share.sensor_fraction, seen: share.seen, frames }
    }
}

/// How often each share of each frame counts; `agreeing` are the frames' own weights, `earlier` what stands before them.
pub fn repeated(frames: &[Placed], agreeing: &[[f64; 3]], earlier: &[Shown]) -> Vec<[f64; 3]> {
    let all = shown(frames, agreeing, earlier);
    let standing: Vec<f64> = frames.iter().map(|frame| alike(frame, frames, agreeing)).collect();
    let of_frame = |(i, frame): (usize, &Placed)| {
        Kind::ALL.map(|kind| {
            let Some(share) = frame.share(kind) else { return 0.0 };
            let once = if kind == Kind::Cone { 1.0 / standing[i].max(1.0) } else { 1.0 };
            agreeing[i][kind as usize] * counts(&Shown::of(share, 1.0), &all).min(once)
        })
    };
    frames.iter().enumerate().map(of_frame).collect()
}

/// How often a share counts among all that are shown.
pub fn counts(share: &Shown, all: &[Shown]) -> f64 {
    let same = all.iter().filter(|other| other.kind == share.kind);
    let n: f64 = same.map(|other| other.frames * (other.seen / share.seen.max(1e-9)).min(1.0)).sum();
    1.0 / (share.sensor_fraction + n.max(1.0) * (1.0 - share.sensor_fraction))
}

/// Everything that is shown, by the frames and before them.
pub fn shown(frames: &[Placed], agreeing: &[[f64; 3]], earlier: &[Shown]) -> Vec<Shown> {
    let of_frame = |(frame, weights): (&Placed, &[f64; 3])| {
        let weights = *weights;
        frame.shares.iter().map(move |share| Shown::of(share, weights[share.kind as usize])).collect::<Vec<_>>()
    };
    frames.iter().zip(agreeing).flat_map(of_frame).chain(earlier.iter().copied()).collect()
}

/// Difference of what frames show of cylinder and cone below which their feed stands, relative.
const STANDS: f64 = 0.03;

/// In how many frames the feed stands as in this one.
fn alike(frame: &Placed, frames: &[Placed], agreeing: &[[f64; 3]]) -> f64 {
    let seen = |frame: &Placed, kind: Kind| frame.share(kind).map_or(0.0, |share| share.seen);
    let same = |other: &Placed| {
        [Kind::Cylinder, Kind::Cone].iter().all(|&kind| {
            let (a, b) = (seen(frame, kind), seen(other, kind));
            (a - b).abs() <= STANDS * a.max(b)
        })
    };
    frames.iter().zip(agreeing).filter(|(other, _)| same(other)).map(|(_, weights)| weights[Kind::Cone as usize]).sum()
}
