//! OpenEXR images.

use super::png::BEST_DEFLATE_RATIO;
use crate::convert::value_error;
use exr::image::read::layers::ReadChannels;
use exr::image::read::read;
use exr::meta::MetaData;
use exr::meta::header::Header;
use exr::prelude::{FlatSamples, ReadLayers};
use numpy::PyArray1;
use pyo3::prelude::*;
use std::path::{Path, PathBuf};

/// A part of an OpenEXR file.
#[pyclass(frozen, get_all, module = "siloscope._core")]
pub struct ExrPart {
    /// Columns.
    width: usize,
    /// Rows.
    height: usize,
    /// Names of its channels.
    channels: Vec<String>,
}

/// Every part of a file. Raises `ValueError` naming the damage.
#[pyfunction]
pub fn exr_parts(py: Python<'_>, path: PathBuf) -> PyResult<Vec<ExrPart>> {
    py.detach(|| headers(&path).map(|found| found.iter().map(described).collect())).map_err(value_error)
}

/// Decodes one channel of one part, row by row: float32 array (H*W,). Raises `ValueError` naming the damage.
#[pyfunction]
pub fn decode_exr(py: Python<'_>, path: PathBuf, part: usize, channel: String) -> PyResult<Bound<'_, PyArray1<f32>>> {
    let samples = py.detach(|| decode(&path, part, &channel)).map_err(value_error)?;
    Ok(PyArray1::from_vec(py, samples))
}

fn headers(path: &Path) -> Result<Vec<Header>, String> {
    let meta = MetaData::read_from_file(path, false).map_err(|e| e.to_string())?;
    Ok(meta.headers.into_iter().collect())
}

fn described(header: &Header) -> ExrPart {
    let size = header.layer_size;
    let channels = header.channels.list.iter().map(|channel| channel.name.to_string()).collect();
    ExrPart { width: size.width(), height: size.height(), channels }
}

fn decode(path: &Path, part: usize, channel: &str) -> Result<Vec<f32>, String> {
    let there = std::fs::metadata(path).map_err(|e| e.to_string())?.len() as usize;
    let headers = headers(path)?;
    let declared = headers.iter().try_fold(0usize, |sum, header| sum.checked_add(pixel_bytes(header)?));
    let most = there.saturating_mul(BEST_DEFLATE_RATIO);
    if declared.is_none_or(|bytes| bytes > most) {
        return Err(format!("{there} bytes can't hold the declared pixels"));
    }
    let reader = read().no_deep_data().largest_resolution_level().all_channels().all_layers().all_attributes();
    let image = reader.non_parallel().from_file(path).map_err(|e| e.to_string())?;
    let layer = image.layer_data.into_iter().nth(part).ok_or_else(|| format!("no part {part}"))?;
    let channels = layer.channel_data.list.into_iter();
    let found = channels.into_iter().find(|found| found.name.eq(channel)).ok_or_else(|| format!("no {channel}"))?;
    Ok(match found.sample_data {
        FlatSamples::F32(v) => v,
        FlatSamples::F16(v) => v.into_iter().map(|sample| sample.to_f32()).collect(),
        FlatSamples::U32(_) => return Err("samples are whole numbers, not floating-point depth".into()),
    })
}

/// Bytes of the part's pixels when decoded.
fn pixel_bytes(header: &Header) -> Option<usize> {
    let pixels = header.layer_size.width().checked_mul(header.layer_size.height())?;
    header.channels.bytes_per_pixel.checked_mul(pixels)
}
