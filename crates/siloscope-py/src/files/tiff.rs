//! Single-channel TIFF.

use super::png::BEST_DEFLATE_RATIO;
use crate::convert::value_error;
use numpy::PyArray1;
use pyo3::prelude::*;
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};
use tiff::ColorType;
use tiff::decoder::{Decoder, DecodingResult, DecodingSampleType, Limits};
use tiff::tags::{CompressionMethod, Tag};

/// LZW writes at least nine bits for a string of at most 4096 bytes.
const BEST_LZW_RATIO: usize = 3_641;
/// PackBits writes two bytes for at most 128.
const BEST_PACKBITS_RATIO: usize = 64;
/// More pages than a recording in one file has.
const MOST_PAGES: usize = 100_000;

type Tiff = Decoder<BufReader<File>>;

/// Width, height and sample type of every page of a TIFF file: a type such as "uint16", or what stands against
/// reading it as depth. Raises `ValueError` naming the damage.
#[pyfunction]
pub fn tiff_pages(py: Python<'_>, path: PathBuf) -> PyResult<Vec<(u32, u32, String)>> {
    py.detach(|| pages(&path)).map_err(value_error)
}

/// Decodes one page into its samples, row by row: array (H*W,) of the type in the file. Raises `ValueError` naming
/// the damage.
#[pyfunction]
pub fn decode_tiff(py: Python<'_>, path: PathBuf, page: usize) -> PyResult<Bound<'_, PyAny>> {
    let samples = py.detach(|| decode(&path, page)).map_err(value_error)?;
    Ok(match samples {
        DecodingResult::U16(v) => PyArray1::from_vec(py, v).into_any(),
        DecodingResult::U32(v) => PyArray1::from_vec(py, v).into_any(),
        DecodingResult::I16(v) => PyArray1::from_vec(py, v).into_any(),
        DecodingResult::I32(v) => PyArray1::from_vec(py, v).into_any(),
        DecodingResult::F32(v) => PyArray1::from_vec(py, v).into_any(),
        DecodingResult::F64(v) => PyArray1::from_vec(py, v).into_any(),
        _ => return Err(value_error("samples of a type that is no depth")),
    })
}

fn open(path: &Path) -> Result<Tiff, String> {
    let file = File::open(path).map_err(|e| e.to_string())?;
    Decoder::new(BufReader::new(file)).map_err(|e| e.to_string())
}

fn pages(path: &Path) -> Result<Vec<(u32, u32, String)>, String> {
    let mut file = open(path)?;
    let mut found = vec![page(&mut file)?];
    while file.more_images() {
        file.next_image().map_err(|e| e.to_string())?;
        found.push(page(&mut file)?);
        if found.len() > MOST_PAGES {
            return Err(format!("more than {MOST_PAGES} pages"));
        }
    }
    Ok(found)
}

fn page(file: &mut Tiff) -> Result<(u32, u32, String), String> {
    let (width, height) = file.dimensions().map_err(|e| e.to_string())?;
    Ok((width, height, sample_type(file)?))
}

fn sample_type(file: &mut Tiff) -> Result<String, String> {
    match file.colortype().map_err(|e| e.to_string())? {
        ColorType::Gray(_) => {}
        other => return Ok(format!("{other:?}")),
    }
    let layout = file.image_buffer_layout().map_err(|e| e.to_string())?;
    Ok(match layout.sample_type {
        Some(DecodingSampleType::U16) => "uint16".into(),
        Some(DecodingSampleType::U32) => "uint32".into(),
        Some(DecodingSampleType::I16) => "int16".into(),
        Some(DecodingSampleType::I32) => "int32".into(),
        Some(DecodingSampleType::F32) => "float32".into(),
        Some(DecodingSampleType::F64) => "float64".into(),
        other => other.map_or("unknown samples".into(), |kind| format!("{kind:?}")),
    })
}

fn decode(path: &Path, page: usize) -> Result<DecodingResult, String> {
    let there = std::fs::metadata(path).map_err(|e| e.to_string())?.len() as usize;
    let mut file = open(path)?;
    file.seek_to_image(page).map_err(|e| e.to_string())?;
    let most = there.saturating_mul(best_ratio(&mut file)?);
    let declared = file.image_buffer_layout().map_err(|e| e.to_string())?.len;
    if declared > most {
        return Err(format!("{there} bytes can't hold the declared {declared}"));
    }
    let mut limits = Limits::default();
    limits.decoding_buffer_size = declared;
    limits.intermediate_buffer_size = most;
    file.with_limits(limits).read_image().map_err(|e| e.to_string())
}

/// How many times smaller the page's compression can make it, which bounds what the file can hold.
fn best_ratio(file: &mut Tiff) -> Result<usize, String> {
    let method = file.find_tag_unsigned::<u16>(Tag::Compression).map_err(|e| e.to_string())?.unwrap_or(1);
    match CompressionMethod::from_u16_exhaustive(method) {
        CompressionMethod::None => Ok(1),
        CompressionMethod::LZW => Ok(BEST_LZW_RATIO),
        CompressionMethod::Deflate | CompressionMethod::OldDeflate => Ok(BEST_DEFLATE_RATIO),
        CompressionMethod::PackBits => Ok(BEST_PACKBITS_RATIO),
        other => Err(format!("compression {other:?} is not read")),
    }
}
