#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

mod bytes;
mod error;
mod factors;
mod json;
mod library;
mod material;
mod sampler;
mod smrl;

use std::path::Path;
use std::sync::OnceLock;

pub use error::Error;
pub use library::{Entry, Library};
pub use material::Kind;

use material::{Material, finite};
use sampler::Sampler;

/// A material. All calls are safe from many threads.
pub struct Brdf {
    material: Material,
    sampler: OnceLock<Sampler>,
}

/// A direction that was drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// The direction to the light.
    pub wi: [f64; 3],
    /// Its density [1/sr]; 0 if none was drawn.
    pub pdf: f64,
    /// f_r cos θ_i / pdf, whose mean is the albedo.
    pub weight: [f64; 3],
}

impl Brdf {
    /// Reads a file (.smrl, .fbrdf). Gives an error for every other file.
    pub fn load(path: impl AsRef<Path>) -> Result<Brdf, Error> {
        Brdf::from_bytes(&bytes_of(path.as_ref(), smrl::LONGEST_FILE as u64)?)
    }

    /// Reads the bytes of a file.
    pub fn from_bytes(bytes: &[u8]) -> Result<Brdf, Error> {
        let read = if bytes.starts_with(b"FBRD") { factors::read_fbrdf } else { smrl::read_smrl };
        read(bytes).map(Brdf::new)
    }

    fn new(material: Material) -> Brdf {
        Brdf { material, sampler: OnceLock::new() }
    }

    /// f_r [1/sr], linear RGB, without the cosine. NaN where a component is NaN or infinite; else 0 where a direction is not above the
    /// horizon.
    pub fn eval(&self, wi: [f64; 3], wo: [f64; 3]) -> [f64; 3] {
        self.material.eval(wi, wo)
    }

    /// Draws a direction to the light with three random numbers from 0 to 1. All is NaN where a component is not finite or a random
    /// number is out of range.
    pub fn sample(&self, wo: [f64; 3], u: [f64; 3]) -> Sample {
        if !wo.iter().all(|x| x.is_finite()) || !u.iter().all(|x| (0.0..=1.0).contains(x)) {
            return Sample { wi: [f64::NAN; 3], pdf: f64::NAN, weight: [f64::NAN; 3] };
        }
        if wo[2] > 0.0 {
            let (wi, density) = self.sampler().draw(wo, u);
            let pdf = finite(density);
            if pdf > 0.0 {
                return Sample { wi, pdf, weight: self.eval(wi, wo).map(|f_r| finite(f_r * wi[2] / pdf)) };
            }
        }
        Sample { wi: [0.0, 0.0, 1.0], pdf: 0.0, weight: [0.0; 3] }
    }

    /// The density [1/sr] with which `sample` draws wi. NaN and 0 as in `eval`.
    pub fn pdf(&self, wi: [f64; 3], wo: [f64; 3]) -> f64 {
        if !wi.iter().chain(&wo).all(|x| x.is_finite()) {
            return f64::NAN;
        }
        if wi[2] > 0.0 && wo[2] > 0.0 { finite(self.sampler().density(wi, wo)).max(0.0) } else { 0.0 }
    }

    /// Fitted when it is first asked for.
    fn sampler(&self) -> &Sampler {
        self.sampler.get_or_init(|| Sampler::fitted(&self.material))
    }

    /// The name.
    pub fn name(&self) -> &str {
        &self.material.name
    }

    /// The SHA-256 of the source in hexadecimal digits, or "".
    pub fn source_sha256(&self) -> &str {
        &self.material.source_sha256
    }

    /// Options and metrics: an object of JSON, or "".
    pub fn notes(&self) -> &str {
        &self.material.notes
    }

    /// What it answers from.
    pub fn kind(&self) -> Kind {
        self.material.kind()
    }

    /// Whether both orders of the directions give the same.
    pub fn reciprocal(&self) -> bool {
        self.material.reciprocal
    }

    /// Whether both sides of the viewer's plane give the same.
    pub fn mirrored(&self) -> bool {
        self.material.mirrored
    }

    /// Whether a channel may be negative.
    pub fn signed(&self) -> bool {
        self.material.signed
    }

    /// Whether values are interpolated.
    pub fn trilinear(&self) -> bool {
        self.material.trilinear()
    }
}

/// The bytes of a file of at most so many.
fn bytes_of(path: &Path, most: u64) -> Result<Vec<u8>, Error> {
    let failed = |error: std::io::Error| Error::File(error.kind());
    if std::fs::metadata(path).map_err(failed)?.len() > most {
        return Err(Error::Contents);
    }
    std::fs::read(path).map_err(failed)
}
