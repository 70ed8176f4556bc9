//! Finds a silo's axis, and with it the transform to gravity-aligned coordinates, in a depth frame.
//!
//! Everything here is pure computation: no files, no printing, no global thread pool. Lengths are metres and
//! angles radians. The camera frame is optical (x right, y down, z forward); the silo frame has its origin on the
//! axis at the camera's height and z along gravity.
//!
//! Three questions, one method each: where is the axis ([`shape_tensor`], the paper's six steps)? What is the wall, and
//! how well is it known ([`surface_fit`])? What is in the vessel ([`content`])? The methods stand side by side on
//! [`geometry`] (pose, camera, wall, vessel), [`stats`] (numerics) and [`base`] (errors, threads); [`fusion`] holds what
//! a frame leaves behind for the fusion of many.

pub mod base;
pub mod content;
pub mod fusion;
pub mod geometry;
pub mod shape_tensor;
pub mod stats;
pub mod surface_fit;

pub use base::error::{Error, Result};
pub use geometry::camera::{Camera, Distortion};
pub use geometry::pose::SiloPose;
pub use stats::nearest::nearest_distances;

/// A point or direction in three dimensions, in metres where it is a point.
pub type Vec3 = nalgebra::Vector3<f64>;
