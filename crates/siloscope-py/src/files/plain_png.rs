//! The usual kind of 16-bit grey PNG, as fast as it goes; whatever is unusual or damaged is left to the library.

use libdeflater::{Crc, Decompressor};

const SIGNATURE: &[u8] = b"\x89PNG\r\n\x1a\n";
/// Bit depth, colour type, compression, filter method, interlacing.
const USUAL: [u8; 5] = [16, 0, 0, 0, 0];
const PIXEL: usize = 2;

struct Chunk<'a> {
    kind: &'a [u8],
    body: &'a [u8],
}

/// The pixels, row by row, or `None` if the file isn't exactly of the usual kind with all its checksums right and no more
/// than `most_pixels`.
///
/// Source: Portable Network Graphics specification (third edition), sections 5, 9 and 10.
pub fn decode(data: &[u8], most_pixels: usize) -> Option<Vec<u16>> {
    let mut rest = data.strip_prefix(SIGNATURE)?;
    let header = next_chunk(&mut rest)?;
    let (width, tail) = header.body.split_first_chunk::<4>()?;
    let (height, kind) = tail.split_first_chunk::<4>()?;
    if header.kind != b"IHDR" || kind != USUAL {
        return None;
    }
    let [width, height] = [width, height].map(|side| u32::from_be_bytes(*side) as usize);
    let pixels = width.checked_mul(height).filter(|n| (1..=most_pixels).contains(n))?;
    let row = 1 + PIXEL * width;
    let mut bytes = vec![0; row * height];
    let size = Decompressor::new().zlib_decompress(&compressed(rest)?, &mut bytes).ok()?;
    if size != bytes.len() {
        return None;
    }
    unfilter(&mut bytes, row)?;
    let mut out = Vec::with_capacity(pixels);
    for line in bytes.chunks_exact(row) {
        out.extend(line[1..].as_chunks::<PIXEL>().0.iter().map(|pair| u16::from_be_bytes(*pair)));
    }
    Some(out)
}

/// Takes the next chunk off, if its checksum is right.
fn next_chunk<'a>(rest: &mut &'a [u8]) -> Option<Chunk<'a>> {
    let (length, tail) = rest.split_first_chunk::<4>()?;
    let (named, tail) = tail.split_at_checked(usize::try_from(u32::from_be_bytes(*length)).ok()?.checked_add(4)?)?;
    let (sum, tail) = tail.split_first_chunk::<4>()?;
    let mut crc = Crc::new();
    crc.update(named);
    *rest = tail;
    let (kind, body) = named.split_at(4);
    (crc.sum() == u32::from_be_bytes(*sum)).then_some(Chunk { kind, body })
}

/// What the data chunks hold together; `None` if there is anything but data, remarks and the end.
fn compressed(mut rest: &[u8]) -> Option<Vec<u8>> {
    let mut all = Vec::with_capacity(rest.len());
    let mut ended = false;
    loop {
        let chunk = next_chunk(&mut rest)?;
        match chunk.kind {
            b"IEND" => return Some(all),
            b"IDAT" if ended => return None,
            b"IDAT" => all.extend_from_slice(chunk.body),
            b"tEXt" | b"zTXt" | b"iTXt" | b"tIME" | b"pHYs" | b"gAMA" => ended |= !all.is_empty(),
            _ => return None,
        }
    }
}

/// Turns differences to the neighbours back into bytes; `None` for a filter that does not exist.
fn unfilter(bytes: &mut [u8], row: usize) -> Option<()> {
    let mut above = vec![0; row - 1];
    for line in bytes.chunks_exact_mut(row) {
        let (filter, line) = line.split_first_mut()?;
        match *filter {
            0 => {}
            1 => from_left(line, &above, |left, _, _| left),
            2 => line.iter_mut().zip(&above).for_each(|(byte, up)| *byte = byte.wrapping_add(*up)),
            3 => from_left(line, &above, |left, up, _| left.midpoint(up)),
            4 => from_left(line, &above, paeth),
            _ => return None,
        }
        above.copy_from_slice(line);
    }
    Some(())
}

/// Adds to every byte what its neighbours to the left, above, and above to the left foretell.
fn from_left(line: &mut [u8], above: &[u8], foretold: impl Fn(u8, u8, u8) -> u8) {
    let (mut left, mut corner) = ([0; PIXEL], [0; PIXEL]);
    for (pixel, &up) in line.as_chunks_mut::<PIXEL>().0.iter_mut().zip(above.as_chunks::<PIXEL>().0) {
        let next = std::array::from_fn(|k| pixel[k].wrapping_add(foretold(left[k], up[k], corner[k])));
        (*pixel, left, corner) = (next, next, up);
    }
}

/// The neighbour nearest to left + up - corner; left before up before corner where they are as near.
///
/// That is the corner if it lies between the two, or else the one farther from it, for which no branch is needed.
fn paeth(left: u8, up: u8, corner: u8) -> u8 {
    let [a, b, c] = [left, up, corner].map(i16::from);
    let (low, high, turn) = (a.min(b), a.max(b), 3 * c - a - b);
    let nearest = if turn <= low {
        high
    } else if turn >= high {
        low
    } else {
        c
    };
    nearest as u8
}
