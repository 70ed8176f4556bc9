//! CRC-32C.

use pyo3::prelude::*;

/// CRC-32C (Castagnoli) of some bytes: the checksum of Zarr chunks and of the pages of E57 files.
#[pyfunction]
pub fn checksum(py: Python<'_>, data: &[u8]) -> u32 {
    py.detach(|| crc32c::crc32c(data))
}
