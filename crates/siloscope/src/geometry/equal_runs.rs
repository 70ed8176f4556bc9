//! Runs of equal depths along the lines of an image: what is left where a driver filled its holes.

/// Numbers of pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct EqualRuns {
    /// In runs of the length asked for, or longer.
    pub long: usize,
    /// In shorter runs of at least half that length.
    pub half: usize,
    /// Equal to the one before.
    pub equal: usize,
    /// With a measurement.
    pub measured: usize,
}

impl EqualRuns {
    /// Adds a line of depths, 0 or NaN for no measurement; a run of `long` pixels is a long one.
    pub fn add(&mut self, line: &[f32], long: usize) {
        for run in line.chunk_by(|a, b| a == b).filter(|run| run.first().is_some_and(|&d| d > 0.0)) {
            self.measured += run.len();
            self.equal += run.len() - 1;
            if run.len() >= long {
                self.long += run.len();
            } else if run.len() >= (long / 2).max(2) {
                self.half += run.len();
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn counted(lines: &[&[f32]], long: usize) -> EqualRuns {
        let mut counts = EqualRuns::default();
        lines.iter().for_each(|line| counts.add(line, long));
        counts
    }

    #[test]
    fn runs_are_counted_by_length_within_their_lines() {
        let lines: [&[f32]; 3] = [&[1.0, 1.0, 1.0, 1.0, 2.0, 3.0, 3.0], &[3.0, 0.0, 0.0, 0.0, 0.0, 0.0, 4.0], &[]];
        assert_eq!(counted(&lines, 4), EqualRuns { long: 4, half: 2, equal: 4, measured: 9 });
        assert_eq!(counted(&lines, 8).half, 4);
        assert_eq!(counted(&[&[f32::NAN, f32::NAN]], 1), EqualRuns::default());
    }
}
