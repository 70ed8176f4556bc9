//! RVL, the lossless compression of depth images in ROS's `compressedDepth`.

use super::png::BEST_DEFLATE_RATIO;
use crate::convert::value_error;
use numpy::PyArray1;
use pyo3::prelude::*;

/// Pixels that an image of any length may have: one without a measurement takes some bytes only.
const MOST_EMPTY_PIXELS: usize = 4_000_000;

/// Undoes RVL: uint16 array (count,). Raises `ValueError` where `data` is damaged or does not give `count` pixels.
///
/// Source: Wilson, "Fast Lossless Depth Image Compression", ISS 2017.
#[pyfunction]
pub fn decompress_rvl<'py>(py: Python<'py>, data: &[u8], count: usize) -> PyResult<Bound<'py, PyArray1<u16>>> {
    let pixels = py.detach(|| rvl(data, count)).map_err(value_error)?;
    Ok(PyArray1::from_vec(py, pixels))
}

fn rvl(data: &[u8], count: usize) -> Result<Vec<u16>, String> {
    if count > MOST_EMPTY_PIXELS.max(data.len().saturating_mul(BEST_DEFLATE_RATIO / 2)) {
        return Err(format!("{} bytes can't hold {count} pixels", data.len()));
    }
    let mut numbers = Nibbles { words: data.as_chunks::<4>().0.iter(), word: 0, left: 0 };
    let mut pixels = Vec::with_capacity(count);
    let mut last = 0i32;
    while pixels.len() < count {
        let (empty, measured) = (numbers.next_number(), numbers.next_number());
        let (Some(empty), Some(measured)) = (empty, measured) else {
            return Err(format!("breaks off after {} of {count} pixels", pixels.len()));
        };
        let room = count - pixels.len();
        if empty + measured > room || empty + measured == 0 {
            return Err(format!("a run of {} pixels where {room} are left", empty + measured));
        }
        pixels.resize(pixels.len() + empty, 0);
        for _ in 0..measured {
            let step = numbers.next_number().ok_or_else(|| format!("breaks off after {} pixels", pixels.len()))?;
            // Steps are folded: 0, -1, 1, -2, ...
            last = last.wrapping_add((step >> 1) as i32 ^ -((step & 1) as i32));
            pixels.push(last as u16);
        }
    }
    Ok(pixels)
}

/// Numbers of variable length in four-bit pieces, the highest piece of a little-endian word first.
struct Nibbles<'a> {
    words: std::slice::Iter<'a, [u8; 4]>,
    word: u32,
    left: u32,
}

impl Nibbles<'_> {
    /// The next number: three bits a piece, the lowest first, the fourth bit while more follow.
    fn next_number(&mut self) -> Option<usize> {
        let mut number = 0;
        for shift in (0..33).step_by(3) {
            let piece = self.next_piece()?;
            number |= u64::from(piece & 7) << shift;
            if piece & 8 == 0 {
                return usize::try_from(number).ok();
            }
        }
        None
    }

    fn next_piece(&mut self) -> Option<u32> {
        if self.left == 0 {
            self.word = u32::from_le_bytes(*self.words.next()?);
            self.left = 8;
        }
        self.left -= 1;
        let piece = self.word >> 28;
        self.word <<= 4;
        Some(piece)
    }
}
