//! A frame's factor about the common answer, in the common answer's parameters.

use crate::fusion::heights::{Heights, by_common};
use crate::fusion::relinearize::{Map, PLACED, Straight, Values};
use crate::geometry::parameters::{OVALITY, PARAMETERS};
use crate::geometry::surface::Part;
use crate::surface_fit::frame_factor::{COAXIAL_COLUMNS, FrameFactor, Kind, Share};
use crate::surface_fit::joint::model::Model;
use crate::surface_fit::joint::parameters::{BIAS, CAMERA, JointState, RADIUS, SIZE, SLOPE};
use nalgebra::{DMatrix, DVector};
use std::borrow::Cow;
use std::cell::OnceCell;

/// The shares of a frame about the common answer: `information` and `gradient` are those of steps from there.
#[derive(Debug, Clone)]
pub struct Placed {
    /// What its tiles say.
    pub shares: Vec<Share>,
}

/// Difference of a wall beyond which a frame's equations are made anew: radians, shares of the radius, the depth's scale,
/// and the cone's slope. What is left out is the product of two of them.
const FAR: f64 = 1e-3;

/// A frame with what places it about any answer of the same heights.
#[derive(Debug)]
pub struct Placing<'a> {
    frame: &'a FrameFactor,
    /// Its parameters by those of the common answer; `None` where they are the same.
    by_common: Option<Vec<Entry>>,
    shares: Vec<Seen<'a>>,
}

/// A share, the entries of `by_common` within its columns, and its rays: these are only asked where an answer is far.
#[derive(Debug)]
struct Seen<'a> {
    share: &'a Share,
    by_common: Option<Vec<Entry>>,
    rays: OnceCell<Option<Straight>>,
}

/// Row, column and value of a map.
type Entry = (usize, usize, f64);

impl<'a> Placing<'a> {
    /// A frame's factor, for answers that are told to the `common` heights.
    pub fn of(frame: &'a FrameFactor, common: &Heights) -> Self {
        Self::new(frame, &Heights::of(&frame.state), common)
    }

    /// A factor that is told to its `own` heights, for answers that are told to the `common` ones.
    pub fn new(frame: &'a FrameFactor, own: &Heights, common: &Heights) -> Self {
        let by_common = by_common(&frame.state, own, common);
        let within = |share: &Share, map: &DMatrix<f64>| {
            let columns = share.kind.columns();
            entries(columns.len(), |r, c| map[(columns[r], columns[c])])
        };
        let seen =
            |share| Seen { share, by_common: by_common.as_ref().map(|map| within(share, map)), rays: OnceCell::new() };
        let shares = frame.shares.iter().map(seen).collect();
        Self { frame, shares, by_common: by_common.map(|map| entries(SIZE, |r, c| map[(r, c)])) }
    }

    /// The frame about a common answer.
    pub fn about(&self, state: &JointState) -> Placed {
        let there = self.by_common.as_ref().map_or_else(
            || DVector::from_row_slice(&state.x),
            |map| {
                let mut there = DVector::zeros(SIZE);
                map.iter().for_each(|&(r, c, value)| there[r] += value * state.x[c]);
                there
            },
        );
        let step = &there - DVector::from_row_slice(&self.frame.state.x);
        let far = is_far(self.frame, &step);
        let placed = |seen: &Seen| {
            let Share { kind, sensor_fraction, seen: fraction, .. } = *seen.share;
            let turn = if far { seen.turn(self.frame, &there, &step) } else { None };
            let step = turn.as_ref().map_or(&step, |turn| &turn.step);
            let own: Vec<f64> = kind.columns().iter().map(|&k| step[k]).collect();
            let mut told = (Cow::Borrowed(seen.share.information.as_slice()), seen.share.gradient_after(&own));
            for map in [turn.as_ref().map(|turn| &turn.entries), seen.by_common.as_ref()].into_iter().flatten() {
                let (information, gradient) = mapped(&told.0, &told.1, map);
                told = (Cow::Owned(information), gradient);
            }
            let (information, gradient) = told;
            Share { kind, information: information.into_owned(), gradient, sensor_fraction, seen: fraction }
        };
        Placed { shares: self.shares.iter().map(placed).collect() }
    }
}

impl Placed {
    /// Moves the point about which the shares are.
    pub fn shift(&mut self, step: &[f64; SIZE]) {
        for share in &mut self.shares {
            let own: Vec<f64> = share.kind.columns().iter().map(|&k| step[k]).collect();
            share.gradient = share.gradient_after(&own);
        }
    }

    /// The share of a kind.
    pub fn share(&self, kind: Kind) -> Option<&Share> {
        self.shares.iter().find(|share| share.kind == kind)
    }
}

/// The entries of a map of n columns that are not zero, column by column: most of a map is the identity.
fn entries(n: usize, value: impl Fn(usize, usize) -> f64) -> Vec<Entry> {
    let all = (0..n).flat_map(|c| (0..n).map(move |r| (r, c)));
    all.map(|(r, c)| (r, c, value(r, c))).filter(|entry| entry.2 != 0.0).collect()
}

/// Mᵀ H M and Mᵀ g, within a share's own columns: the map leaves them among themselves.
fn mapped(information: &[f64], gradient: &[f64], map: &[Entry]) -> (Vec<f64>, Vec<f64>) {
    let n = gradient.len();
    let mut moved = vec![0.0; n];
    map.iter().for_each(|&(r, c, value)| moved[c] += value * gradient[r]);
    let right = times(DMatrix::from_row_slice(n, n, information).as_slice(), map, n);
    (times(DMatrix::from_row_slice(n, n, &right).as_slice(), map, n), moved)
}

/// The columns of a matrix n × n, one after the other, times a map.
fn times(columns: &[f64], map: &[Entry], n: usize) -> Vec<f64> {
    let mut product = vec![0.0; n * n];
    for &(r, c, value) in map {
        let (to, from) = (&mut product[c * n..(c + 1) * n], &columns[r * n..(r + 1) * n]);
        to.iter_mut().zip(from).for_each(|(to, from)| *to += value * from);
    }
    product
}

/// Whether a step leads beyond where a frame's equations hold.
fn is_far(frame: &FrameFactor, step: &DVector<f64>) -> bool {
    let beyond = |columns: &[usize], unit: f64| columns.iter().any(|&k| step[k].abs() > FAR * unit);
    let size = frame.state.size();
    !frame.rays.is_empty() && (beyond(&[0, 1, BIAS + 1, SLOPE], 1.0) || beyond(&[2, 3, BIAS, RADIUS], size))
}

/// The step that predicts, on the rays of a share, the readings of the wall at another place, and its derivative.
struct Turn {
    step: DVector<f64>,
    entries: Vec<Entry>,
}

impl Seen<'_> {
    /// `None` where the rays tell nothing, or the equations can't be turned so far.
    fn turn(&self, frame: &FrameFactor, there: &DVector<f64>, straight: &DVector<f64>) -> Option<Turn> {
        let kind = self.share.kind;
        let (lacking, free) = (lacking(frame), free(frame, kind));
        let length = lengths(frame);
        let place = |x: &[f64]| Values::from_fn(|k, _| if lacking[k] { f64::NAN } else { x[column(k)] / length[k] });
        let only = match kind {
            Kind::Cylinder => Some(Part::Cylinder),
            Kind::Cone => Some(Part::Cone),
            Kind::Whole => None,
        };
        let rays = || Straight::new(&place(&frame.state.x), &frame.rays, (free, &held(frame)), only);
        let (seen, turn) = self.rays.get_or_init(rays).as_ref()?.seen_from(&place(there.as_slice()));
        if !is_usable(&seen, &turn) {
            return None;
        }
        let mut step = straight.clone();
        (0..PLACED).filter(|&r| free[r]).for_each(|r| step[column(r)] = seen[r] * length[r]);
        let of_place = |&k: &usize| (0..PLACED).find(|&placed| column(placed) == k);
        let places: Vec<Option<usize>> = kind.columns().iter().map(of_place).collect();
        let mut entries = Vec::new();
        for (c, place) in places.iter().enumerate() {
            let Some(to) = place.filter(|&k| !lacking[k]) else {
                entries.push((c, c, 1.0));
                continue;
            };
            for (r, place) in places.iter().enumerate() {
                match place.filter(|&k| free[k]) {
                    Some(from) => entries.push((r, c, turn[(from, to)] * length[from] / length[to])),
                    None if r == c => entries.push((c, c, 1.0)),
                    None => {}
                }
            }
        }
        Some(Turn { step, entries })
    }
}

/// Units of the parameters of a place: ovality is a length among all parameters, and a fraction there.
fn lengths(frame: &FrameFactor) -> [f64; PLACED] {
    let radius = if frame.state.has_cylinder { frame.state.x[RADIUS] } else { 1.0 };
    std::array::from_fn(|k| if (OVALITY..PARAMETERS).contains(&k) { radius } else { 1.0 })
}

/// Which of all parameters is one of a place.
fn column(k: usize) -> usize {
    if k < PARAMETERS { COAXIAL_COLUMNS[k] } else { CAMERA + k - PARAMETERS }
}

/// What holds a step that no ray tells: walls are as far apart as a frame's bias and size may be off.
fn held(frame: &FrameFactor) -> Values {
    let size = frame.state.size();
    Values::from_fn(|k, _| {
        let std = match k {
            0 | 1 | 5 => FREE_TURN,
            2 | 3 | 4 | 6 => FREE_TURN * size,
            7..OVALITY => frame.known.bias_std[k - 7].max(1e-9),
            OVALITY..PARAMETERS => FREE_OVALITY,
            _ => frame.known.camera_std[k - PARAMETERS].max(1e-9),
        };
        std.powi(-2)
    })
}

/// Standard deviations of a step: of angles, slopes and shares of the radius; of the ovality.
const FREE_TURN: f64 = 0.1;
const FREE_OVALITY: f64 = 0.005;

/// Which parameters of a place a share of a frame tells.
fn free(frame: &FrameFactor, kind: Kind) -> [bool; PLACED] {
    let lacking = lacking(frame);
    let columns = kind.columns();
    std::array::from_fn(|k| {
        let open = match k {
            7..OVALITY => frame.known.bias_std[k - 7] > 0.0,
            PARAMETERS.. => frame.known.camera_std[k - PARAMETERS] > 0.0,
            _ => true,
        };
        open && !lacking[k] && columns.contains(&column(k))
    })
}

/// Which of them it has no part for; a cone beside the axis is none of the twelve's.
fn lacking(frame: &FrameFactor) -> [bool; PLACED] {
    let cone = frame.state.has_cone && matches!(frame.model, Model::CoaxialCone | Model::ConeAlone);
    std::array::from_fn(|k| match column(k) {
        k if k < RADIUS => false,
        k if k < SLOPE => !frame.state.has_cylinder,
        _ => !cone,
    })
}

/// Whether the equations may be turned so far: a share is not made much surer or vaguer by it.
fn is_usable(step: &Values, turn: &Map) -> bool {
    const LARGEST: f64 = 3.0;
    step.iter().chain(turn.iter()).all(|v| v.is_finite())
        && (0..4).all(|k| (1.0 / LARGEST..LARGEST).contains(&turn[(k, k)]))
}
