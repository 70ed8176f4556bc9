//! What every room needs: errors, refusals, workers, the clock.

pub mod clock;
pub mod error;
pub mod refusal;
pub mod workers;
