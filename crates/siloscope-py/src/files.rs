//! Decoders of compressed file contents that would be slow in Python.

use crate::convert::value_error;
use numpy::PyArray1;
use png::{BitDepth, ColorType, Decoder, Limits};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use std::io::Cursor;

/// Deflate can't compress better than this, so a smaller file can't hold the image it declares.
const BEST_DEFLATE_RATIO: usize = 1032;

/// Decodes a 16-bit grey PNG into its pixels, row by row: uint16 array (H*W,). Raises `ValueError` naming the damage.
#[pyfunction]
fn decode_png16<'py>(py: Python<'py>, data: &[u8]) -> PyResult<Bound<'py, PyArray1<u16>>> {
    let pixels = py.detach(|| png16(data)).map_err(value_error)?;
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

/// Three bytes of LZF stand for at most this many.
const BEST_LZF_RUN: usize = 264;

/// Undoes LZF, the compression of `DATA binary_compressed` in PCD files. Raises `ValueError` where `data` is damaged
/// or does not give exactly `size` bytes.
#[pyfunction]
fn decompress_lzf<'py>(py: Python<'py>, data: &[u8], size: usize) -> PyResult<Bound<'py, PyBytes>> {
    let bytes = py.detach(|| lzf(data, size)).map_err(value_error)?;
    Ok(PyBytes::new(py, &bytes))
}

fn lzf(data: &[u8], size: usize) -> Result<Vec<u8>, String> {
    if size / BEST_LZF_RUN > data.len() / 3 + 1 {
        return Err(format!("{} bytes can't hold the declared {size}", data.len()));
    }
    let mut out = Vec::with_capacity(size);
    let mut rest = data;
    while let Some((&control, after)) = rest.split_first() {
        rest = if control < 32 { literal(&mut out, control, after) } else { repeat(&mut out, control, after) }
            .ok_or_else(|| format!("damaged after {} of {size} bytes", out.len()))?;
        if out.len() > size {
            return Err(format!("gives more than the declared {size} bytes"));
        }
    }
    if out.len() == size { Ok(out) } else { Err(format!("gives {} of {size} bytes", out.len())) }
}

/// Copies `control + 1` bytes as they are.
fn literal<'a>(out: &mut Vec<u8>, control: u8, data: &'a [u8]) -> Option<&'a [u8]> {
    let (run, rest) = data.split_at_checked(usize::from(control) + 1)?;
    out.extend_from_slice(run);
    Some(rest)
}

/// Repeats bytes already written: the length is in the top three bits (and one more byte if they are all set), the
/// distance back in the other five and the next byte. The run may overlap what it writes.
fn repeat<'a>(out: &mut Vec<u8>, control: u8, data: &'a [u8]) -> Option<&'a [u8]> {
    let (mut length, mut data) = (usize::from(control >> 5), data);
    if length == 7 {
        let (&more, rest) = data.split_first()?;
        (length, data) = (length + usize::from(more), rest);
    }
    let (&low, rest) = data.split_first()?;
    let back = (usize::from(control & 31) << 8 | usize::from(low)) + 1;
    let start = out.len().checked_sub(back)?;
    for i in start..start + length + 2 {
        out.push(*out.get(i)?);
    }
    Some(rest)
}

pub fn register(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add_function(wrap_pyfunction!(decode_png16, m)?)?;
    m.add_function(wrap_pyfunction!(decompress_lzf, m)?)
}
