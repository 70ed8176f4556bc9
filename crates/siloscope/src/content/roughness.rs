//! The roughness under which the cells are most probable.

use super::basis::{Basis, RANGES, Roughness};
use super::trend::{Sums, Trend};

/// Values tried for the roughness, from which the evidence chooses.
const BENDS: [f64; 5] = [0.03, 0.1, 0.3, 1.0, 3.0];
const RESTS: [f64; 6] = [0.004, 0.008, 0.016, 0.035, 0.08, 0.16];
/// The trend of the roughness under which the cells are most probable, found by climbing.
pub fn most_probable(sums: &Sums, basis: &Basis) -> Option<(Roughness, Trend)> {
    let mut at = Steps { bend: 2, rest: 0, range: 0 };
    let mut best = sums.solve(basis, at.roughness())?;
    let mut tried = vec![at];
    while let Some(next) = at.around().find(|next| !tried.contains(next)) {
        tried.push(next);
        if let Some(trend) = sums.solve(basis, next.roughness()).filter(|t| t.evidence > best.evidence) {
            (best, at) = (trend, next);
        }
    }
    Some((at.roughness(), best))
}

/// A place in the lists of values tried for the roughness.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Steps {
    bend: usize,
    rest: usize,
    range: usize,
}

impl Steps {
    fn roughness(self) -> Roughness {
        Roughness { bend: BENDS[self.bend], rest: RESTS[self.rest], range: self.range }
    }

    /// One step up or down in each list.
    fn around(self) -> impl Iterator<Item = Self> {
        let Self { bend, rest, range } = self;
        let steps = [
            Self { rest: rest.wrapping_sub(1), ..self },
            Self { rest: rest + 1, ..self },
            Self { bend: bend + 1, ..self },
            Self { bend: bend.wrapping_sub(1), ..self },
            Self { range: range + 1, ..self },
            Self { range: range.wrapping_sub(1), ..self },
        ];
        steps.into_iter().filter(|s| s.bend < BENDS.len() && s.rest < RESTS.len() && s.range < RANGES.len())
    }
}
