//! What every room needs: errors, refusals, workers.

pub mod error;
pub mod refusal;
pub mod workers;
