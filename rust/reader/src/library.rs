//! Files of many materials, .smrlib.

use std::path::Path;

use sommerl_codec::{InstructionSet, Layout, NodeLattice, Prior, decode, decode_part};

use crate::bytes::{Reader, crc32, hexadecimal, inflated};
use crate::json::Json;
use crate::material::Material;
use crate::smrl::{LONGEST_FILE, on_nodes, read_smrl};
use crate::{Brdf, Error, bytes_of};

/// What a library says of a material.
#[derive(Clone, Debug)]
pub struct Entry {
    /// By which `Library::brdf` finds it.
    pub name: String,
    /// The path of the file it was made from.
    pub source: String,
    /// The SHA-256 of that file in hexadecimal digits, or "".
    pub source_sha256: String,
    /// The length of that file.
    pub source_bytes: u64,
    /// How it was compressed: an object of JSON.
    pub options: String,
    /// Red, green, blue (linear), gloss, metalness.
    pub looks: [f32; 5],
    /// In the order of `Library::metrics`; NaN where there is none.
    pub metrics: Vec<f32>,
}

/// A library, whose bytes stay in memory; materials are read when they are asked for.
pub struct Library {
    bytes: Vec<u8>,
    shared: Option<Shared>,
    entries: Vec<Entry>,
    places: Vec<Place>,
    metrics: Vec<String>,
}

struct Place {
    at: usize,
    size: usize,
    crc: u32,
    is_part: bool,
}

/// What materials may share.
struct Shared {
    lattices: Vec<NodeLattice>,
    prior: Prior,
}

impl Library {
    /// Reads a file. Gives an error for every file that is no library.
    pub fn load(path: impl AsRef<Path>) -> Result<Library, Error> {
        Library::from_bytes(bytes_of(path.as_ref(), u64::MAX)?)
    }

    /// Reads the bytes of a file.
    pub fn from_bytes(bytes: Vec<u8>) -> Result<Library, Error> {
        let mut reader = Reader(&bytes);
        if bytes.len() < 12 {
            return Err(Error::Truncated);
        }
        if reader.take(4)? != b"SMLB" {
            return Err(Error::Kind);
        }
        if reader.u16()? != 1 {
            return Err(Error::Version);
        }
        let (crc, table) = (reader.u32()?, reader.0);
        let count = usize::from(reader.u16()?);
        if count > 64 || table.get(..2 + 16 * count).is_none_or(|table| crc32(table) != crc) {
            return Err(Error::Checksum);
        }
        let mut table = Reader(reader.take(16 * count)?);
        let mut sections = [None; 3];
        let mut start = 0;
        for _ in 0..count {
            let (kind, flags, size, crc) = (table.u16()?, table.u16()?, table.u64()?, table.u32()?);
            let at = bytes.len() - reader.0.len();
            let section = reader.take(usize::try_from(size).map_err(|_| Error::Truncated)?)?;
            let Some(known) = usize::from(kind).checked_sub(1).and_then(|kind| sections.get_mut(kind)) else {
                if flags & 1 == 1 {
                    return Err(Error::Version);
                }
                continue;
            };
            if known.replace(section).is_some() {
                return Err(Error::Contents);
            }
            if kind == 2 {
                start = at;
            } else if crc32(section) != crc {
                return Err(Error::Checksum);
            }
        }
        let [Some(index), Some(materials), shared] = sections else { return Err(Error::Contents) };
        if !reader.0.is_empty() {
            return Err(Error::Contents);
        }
        let shared = shared.map(Shared::read).transpose()?;
        let (entries, places, metrics) = read_index(index, bytes.len(), start, materials.len(), shared.is_some())?;
        Ok(Library { shared, entries, places, metrics, bytes })
    }

    /// What is known of the materials, sorted by name.
    pub fn entries(&self) -> &[Entry] {
        &self.entries
    }

    /// The names of the metrics.
    pub fn metrics(&self) -> &[String] {
        &self.metrics
    }

    /// A material. Gives `Error::Missing` if there is none of that name.
    pub fn brdf(&self, name: &str) -> Result<Brdf, Error> {
        let number =
            self.entries.binary_search_by(|entry| entry.name.as_str().cmp(name)).map_err(|_| Error::Missing)?;
        let (place, entry) = (&self.places[number], &self.entries[number]);
        let bytes = self.bytes.get(place.at..place.at + place.size).ok_or(Error::Truncated)?;
        if crc32(bytes) != place.crc {
            return Err(Error::Checksum);
        }
        let material = match &self.shared {
            Some(shared) if place.is_part => Material {
                name: entry.name.clone(),
                source_sha256: entry.source_sha256.clone(),
                notes: format!("{{\"options\":{}}}", entry.options),
                ..shared.part(bytes)?
            },
            _ => read_smrl(bytes)?,
        };
        Ok(Brdf::new(material))
    }
}

impl Shared {
    fn read(bytes: &[u8]) -> Result<Shared, Error> {
        let mut reader = Reader(bytes);
        let count = reader.u8()?;
        let mut prior = Prior { weights: Default::default(), levels: Default::default() };
        let mut fits = count > 0 && bytes.len() <= 1 << 24;
        for weight in prior.weights.as_flattened_mut() {
            *weight = reader.f32()?.into();
            fits &= weight.abs() <= 16.0;
        }
        for level in &mut prior.levels {
            *level = reader.f32()?.into();
            fits &= *level > 0.0 && *level <= 1024.0;
        }
        let mut lattices: Vec<NodeLattice> = Vec::new();
        for _ in 0..count {
            let flags = reader.u8()?;
            let length = reader.u16()?;
            let stream = reader.take(length.into())?;
            if !fits || flags > 3 {
                return Err(Error::Contents);
            }
            let layout = Layout::Second { reciprocal: flags & 1 != 0, mirrored: flags & 2 != 0 };
            let even = decode(stream, layout, InstructionSet::fastest())?;
            let new = !lattices.contains(&even.lattice);
            fits = new && even.palette.gains == [0] && even.palette.shapes == [[0, 0]];
            lattices.push(even.lattice);
        }
        if fits && reader.0.is_empty() { Ok(Shared { lattices, prior }) } else { Err(Error::Contents) }
    }

    fn part(&self, bytes: &[u8]) -> Result<Material, Error> {
        let mut reader = Reader(bytes);
        let (number, flags, scale) = (reader.u8()?, reader.u8()?, reader.f32()?);
        let lattice = self.lattices.get(usize::from(number)).filter(|_| flags & !12 == 0).ok_or(Error::Contents)?;
        on_nodes(scale, flags, || Ok(decode_part(reader.0, lattice, &self.prior, InstructionSet::fastest())?))
    }
}

type Index = (Vec<Entry>, Vec<Place>, Vec<String>);

/// bytes: of the whole file. start, left: where its materials begin, and how long they are.
fn read_index(index: &[u8], bytes: usize, start: usize, mut left: usize, shares: bool) -> Result<Index, Error> {
    let mut head = Reader(index);
    let (n, k) = (head.u32()? as usize, usize::from(head.u8()?));
    let [common, names, sources] = [head.u32()?, head.u32()?, head.u32()?].map(|length| length as usize);
    let size = (65 + 4 * k as u64) * n as u64 + (common as u64 + names as u64 + sources as u64);
    if size > (1 << 28).min(64 * bytes as u64) || common > 1 << 20 {
        return Err(Error::Contents);
    }
    let payload = inflated(head.0, size as usize)?;
    let mut reader = Reader(&payload);
    let mut column = |width: usize| reader.take(width * n);
    let (name_lengths, source_lengths, lengths) = (column(2)?, column(2)?, column(4)?);
    let (crcs, kinds, options, source_bytes) = (column(4)?, column(1)?, column(2)?, column(8)?);
    let (digests, looks, values) = (column(32)?, column(10)?, column(4 * k)?);
    let (metrics, sets) = read_common(reader.take(common)?, k).ok_or(Error::Notes)?;
    let (mut name_texts, mut source_texts) = (Reader(reader.take(names)?), Reader(reader.0));
    let u16_at = |of: &[u8], i: usize| Reader(&of[2 * i..]).u16();
    let u32_at = |of: &[u8], i: usize| Reader(&of[4 * i..]).u32();
    let (mut entries, mut places): (Vec<Entry>, Vec<Place>) = (Vec::new(), Vec::new());
    let mut at = start;
    for i in 0..n {
        let name = text(&mut name_texts, u16_at(name_lengths, i)?)?;
        let source = text(&mut source_texts, u16_at(source_lengths, i)?)?;
        if name.is_empty() || entries.last().is_some_and(|before| *before.name >= *name) {
            return Err(Error::Name);
        }
        let size = u32_at(lengths, i)? as usize;
        let set = sets.get(usize::from(u16_at(options, i)?)).ok_or(Error::Contents)?;
        if size > left || size > LONGEST_FILE {
            return Err(Error::Contents);
        }
        if kinds[i] > u8::from(shares) {
            return Err(Error::Version);
        }
        places.push(Place { at, size, crc: u32_at(crcs, i)?, is_part: kinds[i] == 1 });
        (at, left) = (at + size, left - size);
        let digest: [u8; 32] = core::array::from_fn(|b| digests[b * n + i]);
        let mut shown = [0.0; 5];
        for (c, look) in shown.iter_mut().enumerate() {
            *look = f32::from(u16_at(looks, c * n + i)?) / 10000.0;
        }
        entries.push(Entry {
            name: name.into(),
            source: source.into(),
            source_sha256: if digest == [0; 32] { String::new() } else { hexadecimal(&digest) },
            source_bytes: Reader(&source_bytes[8 * i..]).u64()?,
            options: set.clone(),
            looks: shown,
            metrics: (0..k).map(|m| Reader(&values[4 * (m * n + i)..]).f32()).collect::<Result<_, _>>()?,
        });
    }
    let filled = left == 0 && name_texts.0.is_empty() && source_texts.0.is_empty();
    if filled { Ok((entries, places, metrics)) } else { Err(Error::Contents) }
}

fn text<'a>(texts: &mut Reader<'a>, length: u16) -> Result<&'a str, Error> {
    let bytes = if length > 1 << 14 { Err(Error::Name) } else { texts.take(length.into()) };
    core::str::from_utf8(bytes?).ok().filter(|text| !text.contains('\0')).ok_or(Error::Name)
}

/// Names of metrics, and sets of options.
fn read_common(bytes: &[u8], count: usize) -> Option<(Vec<String>, Vec<String>)> {
    let mut json = Json::new(core::str::from_utf8(bytes).ok()?);
    let (mut metrics, mut sets, mut parts): (Vec<String>, Vec<String>, usize) = (Vec::new(), Vec::new(), 0);
    json.object(|json, key| {
        parts += usize::from(["metrics", "options"].contains(&key));
        match key {
            "metrics" => json.list(|json| {
                let name = json.string()?;
                let fine =
                    name.chars().count() <= 100 && metrics.len() < 64 && !metrics.iter().any(|other| other == name);
                metrics.push(name.into());
                fine.then_some(())
            }),
            "options" => json.list(|json| {
                let start = json.rest();
                json.plain(true)?;
                let left = json.0.len();
                sets.push(start[..start.len() - left].into());
                Some(())
            }),
            _ => json.value(31),
        }
    })?;
    json.ends()?;
    (parts == 2 && metrics.len() == count).then_some((metrics, sets))
}
