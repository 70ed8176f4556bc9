//! Decoders of file contents that would be slow in Python, or less safe in C.

mod checksum;
mod exr;
mod lzf;
mod plain_png;
mod png;
mod rvl;
mod tiff;

use pyo3::prelude::*;

pub fn register(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add_function(wrap_pyfunction!(png::decode_png16, m)?)?;
    m.add_function(wrap_pyfunction!(lzf::decompress_lzf, m)?)?;
    m.add_function(wrap_pyfunction!(rvl::decompress_rvl, m)?)?;
    m.add_class::<tiff::TiffPage>()?;
    m.add_class::<exr::ExrPart>()?;
    m.add_function(wrap_pyfunction!(tiff::tiff_pages, m)?)?;
    m.add_function(wrap_pyfunction!(tiff::decode_tiff, m)?)?;
    m.add_function(wrap_pyfunction!(checksum::checksum, m)?)?;
    m.add_function(wrap_pyfunction!(exr::exr_parts, m)?)?;
    m.add_function(wrap_pyfunction!(exr::decode_exr, m)?)
}
