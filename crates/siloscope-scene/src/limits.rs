//! Bounds of the numbers that a caller gives.

use siloscope::{Error, Result};

/// Refuses a number outside its bounds by the name the user gave it.
pub fn bounded(name: &'static str, value: f64, low: f64, high: f64, bounds: &'static str) -> Result<()> {
    if (low..=high).contains(&value) { Ok(()) } else { Err(Error::Setting { name, bounds, value }) }
}
