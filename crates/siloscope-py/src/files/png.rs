//! 16-bit grey PNG.

use super::plain_png;
use crate::convert::value_error;
use numpy::PyArray1;
use png::{BitDepth, ColorType, Decoder, Limits};
use pyo3::prelude::*;
use std::io::Cursor;

/// Deflate can't compress better than this, so a smaller file can't hold the image it declares.
pub const BEST_DEFLATE_RATIO: usize = 1032;

/// Decodes a 16-bit grey PNG into its pixels, row by row: uint16 array (H*W,). Raises `ValueError` naming the damage.
#[pyfunction]
pub fn decode_png16<'py>(py: Python<'py>, data: &[u8]) -> PyResult<Bound<'py, PyArray1<u16>>> {
    let most = data.len().saturating_mul(BEST_DEFLATE_RATIO / 2);
    let pixels = py.detach(|| plain_png::decode(data, most).map_or_else(|| png16(data), Ok)).map_err(value_error)?;
    Ok(PyArray1::from_vec(py, pixels))
}

fn png16(data: &[u8]) -> Result<Vec<u16>, String> {
    let most = data.len().saturating_mul(BEST_DEFLATE_RATIO);
    let mut decoder = Decoder::new_with_limits(Cursor::new(data), Limits { bytes: most });
    decoder.ignore_checksums(false);
    let mut reader = decoder.read_info().map_err(|e| e.to_string())?;
    let (width, height) = reader.info().size();
    if (reader.info().bit_depth, reader.info().color_type) != (BitDepth::Sixteen, ColorType::Grayscale) {
        return Err("not 16-bit grey".into());
    }
    let (width, height) = (width as usize, height as usize);
    let pixels = width.checked_mul(height).filter(|n| n / (BEST_DEFLATE_RATIO / 2) <= data.len());
    let pixels = pixels.ok_or_else(|| format!("{} bytes can't hold {width} x {height} pixels", data.len()))?;
    if reader.info().interlaced {
        let mut bytes = vec![0; pixels * 2];
        reader.next_frame(&mut bytes).map_err(|e| e.to_string())?;
        return Ok(from_big_endian(&bytes).collect());
    }
    let mut out = Vec::with_capacity(pixels);
    while let Some(row) = reader.next_row().map_err(|e| e.to_string())? {
        out.extend(from_big_endian(row.data()));
    }
    reader.finish().map_err(|e| e.to_string())?;
    if out.len() == pixels { Ok(out) } else { Err(format!("{} of {pixels} pixels", out.len())) }
}

fn from_big_endian(bytes: &[u8]) -> impl Iterator<Item = u16> + '_ {
    bytes.as_chunks::<2>().0.iter().map(|pair| u16::from_be_bytes(*pair))
}
