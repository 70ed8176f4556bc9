//! What a frame leaves behind for the fusion of many.

pub mod frame_factor;
pub mod relinearize;
