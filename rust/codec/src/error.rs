//! Why a stream cannot be read, or a material cannot be written.

use std::fmt;

use crate::lattice::{FINE, MOST_BANDS, MOST_NODES};
use crate::palette::{HIGHEST_GAIN, MOST_ENTRIES, WIDEST_SHAPE};

/// One variant for each cause. `Display` gives the sentence that the readers in Python and in JavaScript give too.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Error {
    /// The stream has this number of bands, which is too many.
    Bands(i64),
    /// The stream gives a band of the lattice `found` rows, where `left` are left.
    RowsOfBand {
        /// Rows of the lattice that belong to no band before.
        left: i64,
        /// Rows that the band would have.
        found: i64,
    },
    /// The stream has a node at this step of the fine grid, which lies beyond the end of its axis.
    Axis(i64),
    /// The stream has a lattice with this number of nodes, which is too many.
    Nodes(i64),
    /// The stream has a palette with this number of gains, which is too many.
    Gains(i64),
    /// The stream has a palette with this number of shapes, which is too many.
    Shapes(i64),
    /// The stream has a gain with the code `found`, which is too high, or lower than `least`.
    GainCode {
        /// The lowest code that there is in this version of the format.
        least: i64,
        /// The code that the gain would have.
        found: i64,
    },
    /// The stream has a shape with a coordinate of this code, which is too low or too high.
    ShapeCode(i64),
    /// The stream leads the range decoder to a code that belongs to no symbol.
    NoSymbol,
    /// The stream can be decoded, but the encoder writes another one for what was found: something follows the end, was cut off,
    /// or was changed.
    OtherStream,
    /// Reading the stream would take more work than its length allows: more than so many entries within reach.
    Reached(usize),
    /// The lattice, which was to be written, has axes that do not increase from 0 to their ends, or its bands do not fit.
    Lattice,
    /// The palette, which was to be written, has no entries or too many.
    PaletteSize,
    /// The palette, which was to be written, has codes out of order or out of bounds.
    PaletteCodes,
    /// The indices, which were to be written, are not one for each node, or lead outside the palette.
    Indices,
}

impl std::error::Error for Error {}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let (entries, widest) = (MOST_ENTRIES as i64, i64::from(WIDEST_SHAPE));
        let mut range = |what: &str, least: i64, most: i64, found: i64| {
            write!(f, "{what}: expected {least} to {most}, found {found}")
        };
        match *self {
            Error::Bands(found) => range("bands", 1, MOST_BANDS as i64, found),
            Error::RowsOfBand { left, found } => range("rows of a band", 1, left, found),
            Error::Axis(found) => range("axis", 1, i64::from(FINE) - 1, found),
            Error::Nodes(found) => range("nodes", 1, MOST_NODES as i64, found),
            Error::Gains(found) => range("gains", 1, entries, found),
            Error::Shapes(found) => range("shapes", 1, entries, found),
            Error::GainCode { least, found } => range("gain", least, i64::from(HIGHEST_GAIN), found),
            Error::ShapeCode(found) => range("shape", -widest, widest, found),
            Error::NoSymbol => {
                f.write_str("stream: expected symbols of the range coder, found a code beyond all of them")
            }
            Error::OtherStream => f.write_str("expected a stream of nodes that ends with the file, found another"),
            Error::Reached(most) => write!(f, "entries within reach: expected at most {most}, found more"),
            Error::Lattice => {
                f.write_str("lattice: expected nodes that increase on each axis, and bands in order, found others")
            }
            Error::PaletteSize => write!(f, "palette: expected 1 to {entries} gains and shapes"),
            Error::PaletteCodes => {
                f.write_str("palette: expected codes in order and within their bounds, found others")
            }
            Error::Indices => f.write_str("expected an entry of the palette for each node"),
        }
    }
}
