//! Finds a silo's axis, and with it the transform to gravity-aligned coordinates, in a depth frame.
//!
//! Everything here is pure computation: no files, no printing, no global thread pool. Lengths are metres and
//! angles radians. The camera frame is optical (x right, y down, z forward); the silo frame has its origin on the
//! axis at the camera's height and z along gravity.

pub mod axis;
pub mod axis_covariance;
pub mod backproject;
pub mod blocks;
pub mod bow;
pub mod camera;
pub mod candidates;
pub mod cloud;
pub mod coarse;
pub mod common;
pub mod content;
pub mod covariance;
pub mod coverage;
pub mod eigen;
pub mod error;
pub mod evidence;
pub mod fit;
pub mod grain;
pub mod grid;
pub mod known_wall;
pub mod labels;
pub mod locate;
mod misfit;
pub mod nearest;
pub mod neighbours;
pub mod normals;
pub mod outermost;
pub mod parts;
pub mod patches;
pub mod pixels;
pub mod polish;
pub mod pose;
pub mod profile;
pub mod refine;
pub mod refusal;
pub mod sensor;
pub mod shape_tensor;
pub mod share;
pub mod start;
pub mod straight;
pub mod surface;
pub mod taper;
pub mod verdict;
pub mod vertex;
pub mod workers;

pub use camera::{Camera, Distortion};
pub use error::{Error, Result};
pub use nearest::nearest_distances;
pub use pose::SiloPose;

/// A point or direction in three dimensions, in metres where it is a point.
pub type Vec3 = nalgebra::Vector3<f64>;
