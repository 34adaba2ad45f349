//! Why something cannot be read.

use core::fmt;

/// One variant for each cause. `Display` gives a sentence.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Error {
    /// The file cannot be opened or read.
    File(std::io::ErrorKind),
    /// The file is of another kind.
    Kind,
    /// The file is of a version that is not known.
    Version,
    /// The checksum is another: the file is damaged or cut off.
    Checksum,
    /// The file ends too early.
    Truncated,
    /// A name is not UTF-8, is out of order or too long.
    Name,
    /// Notes are not as the format says.
    Notes,
    /// A count, a flag or a value is out of its bounds.
    Contents,
    /// A deflate stream is damaged, or is not all of the rest.
    Stream,
    /// The stream of a compact material is not one that a writer gives.
    Nodes(sommerl_codec::Error),
    /// The library has no material of that name.
    Missing,
}

impl core::error::Error for Error {}

impl From<sommerl_codec::Error> for Error {
    fn from(error: sommerl_codec::Error) -> Self {
        Error::Nodes(error)
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(match self {
            Error::File(kind) => return write!(f, "expected a file that can be read, found none ({kind})"),
            Error::Kind => "expected a file of Sommerl's (.smrl, .smrlib, .fbrdf) of the asked kind, found another",
            Error::Version => "expected a known version of the format, found another; a newer crate may read it",
            Error::Checksum => "expected the checksum in the file, found another: the file is damaged or cut off",
            Error::Truncated => "expected more bytes, found the end of the file",
            Error::Name => "expected names in UTF-8, sorted and of a bounded length, found others",
            Error::Notes => "expected notes of plain JSON, found others",
            Error::Contents => "expected counts, flags and values within their bounds, found others",
            Error::Stream => "expected a compressed stream that ends with the file, found another",
            Error::Nodes(error) => return error.fmt(f),
            Error::Missing => "expected a material of that name in the library, found none",
        })
    }
}
