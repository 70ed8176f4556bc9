//! A frame's factor about the common answer, in the common answer's parameters.

use crate::fusion::heights::{Heights, by_common};
use crate::fusion::relinearize::{Map, PLACED, Values, seen_from};
use crate::geometry::parameters::{OVALITY, PARAMETERS};
use crate::geometry::surface::Part;
use crate::surface_fit::frame_factor::{COAXIAL_COLUMNS, FrameFactor, Kind, Share};
use crate::surface_fit::joint::model::Model;
use crate::surface_fit::joint::parameters::{BIAS, CAMERA, JointState, RADIUS, SIZE, SLOPE};
use nalgebra::{DMatrix, DVector};

/// The shares of a frame about the common answer: `information` and `gradient` are those of steps from there.
#[derive(Debug, Clone)]
pub struct Placed {
    /// What its tiles say.
    pub shares: Vec<Share>,
}

/// Difference of a wall beyond which a frame's equations are made anew: radians, shares of the radius, the depth's scale,
/// and the cone's slope. What is left out is the product of two of them.
const FAR: f64 = 1e-3;

impl Placed {
    /// A factor told to its `own` heights about the common answer, which is told to the `common` ones.
    pub fn new(frame: &FrameFactor, own: &Heights, (state, common): (&JointState, &Heights)) -> Self {
        let at = DVector::from_row_slice(&state.x);
        let by_common = by_common(&frame.state, own, common);
        let there = by_common.as_ref().map_or_else(|| at.clone(), |map| map * &at);
        let step = &there - DVector::from_row_slice(&frame.state.x);
        let far = is_far(frame, &step);
        let placed = |share: &Share| {
            let turn = if far { Turn::new(frame, share.kind, &there, &step) } else { None };
            let step = turn.as_ref().map_or(&step, |turn| &turn.step);
            let own: Vec<f64> = share.kind.columns().iter().map(|&k| step[k]).collect();
            let mut placed = Share { gradient: share.gradient_after(&own), ..share.clone() };
            for map in [turn.as_ref().map(|turn| &turn.matrix), by_common.as_ref()].into_iter().flatten() {
                placed = mapped(placed, map);
            }
            placed
        };
        Self { shares: frame.shares.iter().map(placed).collect() }
    }

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

/// Mᵀ H M and Mᵀ g, within the share's own columns: the map leaves them among themselves.
fn mapped(share: Share, map: &DMatrix<f64>) -> Share {
    let columns = share.kind.columns();
    let n = columns.len();
    // most of a map is the identity
    let mut entries = Vec::new();
    for c in 0..n {
        entries.extend((0..n).map(|r| (r, c, map[(columns[r], columns[c])])).filter(|entry| entry.2 != 0.0));
    }
    let information = DMatrix::from_row_slice(n, n, &share.information);
    let (mut right, mut turned, mut moved) = (DMatrix::zeros(n, n), DMatrix::zeros(n, n), vec![0.0; n]);
    for &(r, c, value) in &entries {
        right.column_mut(c).axpy(value, &information.column(r), 1.0);
        moved[c] += value * share.gradient[r];
    }
    let right: DMatrix<f64> = right.transpose();
    for &(r, c, value) in &entries {
        turned.column_mut(c).axpy(value, &right.column(r), 1.0);
    }
    Share { information: turned.as_slice().to_vec(), gradient: moved, ..share }
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
    matrix: DMatrix<f64>,
}

impl Turn {
    /// `None` where the rays tell nothing, or the equations can't be turned so far.
    fn new(frame: &FrameFactor, kind: Kind, there: &DVector<f64>, straight: &DVector<f64>) -> Option<Self> {
        let radius = if frame.state.has_cylinder { frame.state.x[RADIUS] } else { 1.0 };
        let length = |k: usize| if (OVALITY..PARAMETERS).contains(&k) { radius } else { 1.0 };
        let (lacking, free) = (lacking(frame), free(frame, kind));
        let place = |of: &dyn Fn(usize) -> f64| {
            Values::from_fn(|k, _| if lacking[k] { f64::NAN } else { of(column(k)) / length(k) })
        };
        let base = place(&|k| frame.state.x[k]);
        let only = match kind {
            Kind::Cylinder => Some(Part::Cylinder),
            Kind::Cone => Some(Part::Cone),
            Kind::Whole => None,
        };
        let (seen, turn) = seen_from(&base, &frame.rays, (free, &held(frame)), (&place(&|k| there[k]), only))?;
        if !is_usable(&seen, &turn) {
            return None;
        }
        let (mut step, mut matrix) = (straight.clone(), DMatrix::identity(SIZE, SIZE));
        for r in (0..PLACED).filter(|&r| free[r]) {
            step[column(r)] = seen[r] * length(r);
            for c in (0..PLACED).filter(|&c| !lacking[c]) {
                matrix[(column(r), column(c))] = turn[(r, c)] * length(r) / length(c);
            }
        }
        Some(Self { step, matrix })
    }
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
