//! What a silo, a camera and its sensor are.

pub mod backproject;
pub mod camera;
pub mod normals;
pub mod pose;
pub mod sensor;
pub mod vessel;
