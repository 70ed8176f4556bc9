//! Numerics that know nothing of silos.

pub mod blocks;
pub mod eigen;
pub mod nearest;
pub mod neighbours;
pub mod robust;
pub mod voxel_grid;
