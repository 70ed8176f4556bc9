//! LZF, the compression of `DATA binary_compressed` in PCD files.

use crate::convert::value_error;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

/// Three bytes of LZF stand for at most this many.
const BEST_LZF_RUN: usize = 264;

/// Undoes LZF, the compression of `DATA binary_compressed` in PCD files. Raises `ValueError` where `data` is damaged
/// or does not give exactly `size` bytes.
#[pyfunction]
pub fn decompress_lzf<'py>(py: Python<'py>, data: &[u8], size: usize) -> PyResult<Bound<'py, PyBytes>> {
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
