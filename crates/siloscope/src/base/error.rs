//! Errors of the public API.

/// Result of the core's entry points.
pub type Result<T> = std::result::Result<T, Error>;

/// Input that the core can't use. A frame that is usable but shows too little is no error: see `Status`.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Error {
    /// A setting is outside its bounds.
    #[error("{name} must be {bounds}, got {value}")]
    Setting {
        /// The setting's name as the user writes it.
        name: &'static str,
        /// The allowed range in words.
        bounds: &'static str,
        /// What was given.
        value: f64,
    },
    /// Two inputs that belong together disagree in size.
    #[error("{what} has {got} entries, expected {expected}")]
    Shape {
        /// Which input.
        what: &'static str,
        /// Its number of entries.
        got: usize,
        /// The number it needs.
        expected: usize,
    },
}
