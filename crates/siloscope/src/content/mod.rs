//! What is in the silo: the surface of the content and the volume under it.

pub mod basis;
pub mod bound;
pub mod cells;
pub mod classify;
pub mod cloud;
pub mod detail;
pub mod doubt;
pub mod drift;
pub mod fit;
pub mod grid;
pub mod measure;
pub mod returns;
pub mod shape;
pub mod sight;
pub mod trend;
pub mod volume;
pub mod wall;
