//! Many frames of one silo and camera: their factors solved together.

pub mod agreement;
pub mod common;
pub mod contrast;
pub mod earlier;
#[allow(clippy::module_inception)]
pub mod fusion;
pub mod heights;
pub mod moves;
pub mod placed;
pub mod relinearize;
pub mod solve;
pub mod start;
pub mod sum;
