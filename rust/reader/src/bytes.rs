//! Bytes, read one part after the other; checksums; and deflate streams.

use miniz_oxide::inflate::TINFLStatus;
use miniz_oxide::inflate::core::inflate_flags::TINFL_FLAG_USING_NON_WRAPPING_OUTPUT_BUF;
use miniz_oxide::inflate::core::{DecompressorOxide, decompress};

use crate::Error;

/// What of some bytes has not been read yet.
pub struct Reader<'a>(pub &'a [u8]);

impl<'a> Reader<'a> {
    pub fn take(&mut self, count: usize) -> Result<&'a [u8], Error> {
        let (taken, rest) = self.0.split_at_checked(count).ok_or(Error::Truncated)?;
        self.0 = rest;
        Ok(taken)
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], Error> {
        let (taken, rest) = self.0.split_first_chunk().ok_or(Error::Truncated)?;
        self.0 = rest;
        Ok(*taken)
    }

    pub fn u8(&mut self) -> Result<u8, Error> {
        Ok(self.array::<1>()?[0])
    }

    pub fn u16(&mut self) -> Result<u16, Error> {
        self.array().map(u16::from_le_bytes)
    }

    pub fn u32(&mut self) -> Result<u32, Error> {
        self.array().map(u32::from_le_bytes)
    }

    pub fn u64(&mut self) -> Result<u64, Error> {
        self.array().map(u64::from_le_bytes)
    }

    pub fn f32(&mut self) -> Result<f32, Error> {
        self.array().map(f32::from_le_bytes)
    }

    pub fn f64(&mut self) -> Result<f64, Error> {
        self.array().map(f64::from_le_bytes)
    }
}

const CRC: [u32; 256] = {
    let mut table = [0; 256];
    let mut i = 0;
    while i < 256 {
        let (mut x, mut bit) = (i as u32, 0);
        while bit < 8 {
            x = if x & 1 == 1 { x >> 1 ^ 0xedb8_8320 } else { x >> 1 };
            bit += 1;
        }
        table[i] = x;
        i += 1;
    }
    table
};

/// The CRC-32 of zlib.
pub fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0, |crc, &byte| crc >> 8 ^ CRC[usize::from(crc as u8 ^ byte)])
}

/// Inflates a deflate stream (RFC 1951), which has to end with the bytes and to give exactly so many.
pub fn inflated(stream: &[u8], size: usize) -> Result<Vec<u8>, Error> {
    let (mut state, mut room) = (Box::<DecompressorOxide>::default(), vec![0; size]);
    let (status, read, written) =
        decompress(&mut state, stream, &mut room, 0, TINFL_FLAG_USING_NON_WRAPPING_OUTPUT_BUF);
    let whole = status == TINFLStatus::Done && read == stream.len() && written == size;
    if whole { Ok(room) } else { Err(Error::Stream) }
}

/// Some bytes in hexadecimal digits.
pub fn hexadecimal(bytes: &[u8]) -> String {
    let digit = |x: u8| char::from(b"0123456789abcdef"[usize::from(x)]);
    bytes.iter().flat_map(|&byte| [digit(byte >> 4), digit(byte & 15)]).collect()
}

/// A number of half precision, by its bits; NaN also for those that are infinite.
pub fn half(bits: u16) -> f32 {
    let (exponent, rest) = (i32::from(bits >> 10 & 31), f32::from(bits & 1023));
    let power = |n: i32| f32::from_bits(((127 + n) as u32) << 23);
    let size = match exponent {
        31 => f32::NAN,
        0 => rest * power(-24),
        _ => (1024.0 + rest) * power(exponent - 25),
    };
    if bits >> 15 == 1 { -size } else { size }
}
