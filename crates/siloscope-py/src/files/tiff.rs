//! Single-channel TIFF.

use super::png::BEST_DEFLATE_RATIO;
use crate::convert::value_error;
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::pybacked::PyBackedBytes;
use std::fs::File;
use std::io::{BufReader, Cursor, Read, Seek};
use std::path::PathBuf;
use tiff::ColorType;
use tiff::decoder::{Decoder, DecodingResult, DecodingSampleType, Limits};
use tiff::tags::{CompressionMethod, Tag};

/// LZW writes at least nine bits for a string of at most 4096 bytes.
const BEST_LZW_RATIO: usize = 3_641;
/// PackBits writes two bytes for at most 128.
const BEST_PACKBITS_RATIO: usize = 64;
/// More pages than a recording in one file has.
const MOST_PAGES: usize = 100_000;

/// A TIFF's bytes, or the file in which it is.
#[derive(FromPyObject)]
pub enum Source {
    /// The whole file.
    Bytes(PyBackedBytes),
    /// Where the file is.
    Path(PathBuf),
}

trait Readable: Read + Seek {}
impl<R: Read + Seek> Readable for R {}

type Tiff<'a> = Decoder<Box<dyn Readable + 'a>>;

/// A page of a TIFF.
#[pyclass(frozen, get_all, module = "siloscope._core")]
pub struct TiffPage {
    /// Columns.
    width: u32,
    /// Rows.
    height: u32,
    /// A type such as "uint16", or what stands against reading the page as depth.
    sample_type: String,
    /// A compression such as "LZW".
    compression: String,
}

/// Every page of a TIFF. Raises `ValueError` naming the damage.
#[pyfunction]
pub fn tiff_pages(py: Python<'_>, source: Source) -> PyResult<Vec<TiffPage>> {
    py.detach(|| pages(&source)).map_err(value_error)
}

/// Decodes one page into its samples, row by row: array (H*W,) of the type in the file, float32 for float16. Raises
/// `ValueError` naming the damage.
#[pyfunction]
pub fn decode_tiff(py: Python<'_>, source: Source, page: usize) -> PyResult<Bound<'_, PyAny>> {
    let samples = py.detach(|| decode(&source, page)).map_err(value_error)?;
    Ok(match samples {
        DecodingResult::U16(v) => PyArray1::from_vec(py, v).into_any(),
        DecodingResult::U32(v) => PyArray1::from_vec(py, v).into_any(),
        DecodingResult::I16(v) => PyArray1::from_vec(py, v).into_any(),
        DecodingResult::I32(v) => PyArray1::from_vec(py, v).into_any(),
        DecodingResult::F16(v) => PyArray1::from_iter(py, v.into_iter().map(|sample| sample.to_f32())).into_any(),
        DecodingResult::F32(v) => PyArray1::from_vec(py, v).into_any(),
        DecodingResult::F64(v) => PyArray1::from_vec(py, v).into_any(),
        _ => return Err(value_error("samples of a type that is no depth")),
    })
}

fn open(source: &Source) -> Result<(Tiff<'_>, usize), String> {
    let (reader, size): (Box<dyn Readable>, usize) = match source {
        Source::Bytes(data) => (Box::new(Cursor::new(&data[..])), data.len()),
        Source::Path(path) => {
            let file = File::open(path).map_err(|e| e.to_string())?;
            let size = file.metadata().map_err(|e| e.to_string())?.len() as usize;
            (Box::new(BufReader::new(file)), size)
        }
    };
    Ok((Decoder::new(reader).map_err(|e| e.to_string())?, size))
}

fn pages(source: &Source) -> Result<Vec<TiffPage>, String> {
    let (mut file, _) = open(source)?;
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

fn page(file: &mut Tiff<'_>) -> Result<TiffPage, String> {
    let (width, height) = file.dimensions().map_err(|e| e.to_string())?;
    let (sample_type, compression) = (sample_type(file)?, format!("{:?}", compression(file)?));
    Ok(TiffPage { width, height, sample_type, compression })
}

fn sample_type(file: &mut Tiff<'_>) -> Result<String, String> {
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
        Some(DecodingSampleType::F16) => "float16".into(),
        Some(DecodingSampleType::F32) => "float32".into(),
        Some(DecodingSampleType::F64) => "float64".into(),
        other => other.map_or("unknown samples".into(), |kind| format!("{kind:?}")),
    })
}

fn decode(source: &Source, page: usize) -> Result<DecodingResult, String> {
    let (mut file, there) = open(source)?;
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

fn compression(file: &mut Tiff<'_>) -> Result<CompressionMethod, String> {
    let method = file.find_tag_unsigned::<u16>(Tag::Compression).map_err(|e| e.to_string())?.unwrap_or(1);
    Ok(CompressionMethod::from_u16_exhaustive(method))
}

/// How many times smaller the page's compression can make it, which bounds what the file can hold.
fn best_ratio(file: &mut Tiff<'_>) -> Result<usize, String> {
    match compression(file)? {
        CompressionMethod::None => Ok(1),
        CompressionMethod::LZW => Ok(BEST_LZW_RATIO),
        CompressionMethod::Deflate | CompressionMethod::OldDeflate => Ok(BEST_DEFLATE_RATIO),
        CompressionMethod::PackBits => Ok(BEST_PACKBITS_RATIO),
        other => Err(format!("compression {other:?} is not read")),
    }
}
