//! Numerics that know nothing of silos.

pub mod blocks;
pub mod eigen;
pub mod kd_tree;
pub mod line_fit;
pub mod nearest;
pub mod neighbours;
pub mod robust;
pub mod voxel_grid;
