//! Wall-clock time of the steps of a computation.

use std::time::Instant;

/// Milliseconds of named steps, in the order in which they first ended.
#[derive(Debug)]
pub struct Clock {
    last: Instant,
    laps: Vec<(&'static str, f64)>,
}

impl Clock {
    /// Starts the first step.
    pub fn start() -> Self {
        Self { last: Instant::now(), laps: Vec::new() }
    }

    /// Ends a step: adds the time since the last lap to it.
    pub fn lap(&mut self, step: &'static str) {
        let now = Instant::now();
        let elapsed = (now - self.last).as_secs_f64() * 1e3;
        match self.laps.iter_mut().find(|(name, _)| *name == step) {
            Some((_, time)) => *time += elapsed,
            None => self.laps.push((step, elapsed)),
        }
        self.last = now;
    }

    /// The steps with their milliseconds.
    pub fn laps(self) -> Vec<(&'static str, f64)> {
        self.laps
    }
}
