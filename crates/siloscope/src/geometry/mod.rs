//! What a silo, a camera and its sensor are.

pub mod camera;
pub mod convex_vessel;
pub mod depth_image;
pub mod equal_runs;
pub mod evaluator;
pub mod floor_map;
pub mod label;
pub mod normals;
pub mod parameters;
pub mod pose;
pub mod raycast;
pub mod sensor;
pub mod surface;
pub mod vessel;
pub mod view;
