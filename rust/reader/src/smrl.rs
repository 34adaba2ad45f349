//! Files of one material, .smrl. docs/format.md says what each byte means.

use core::f64::consts::{FRAC_PI_2, PI};

use sommerl_codec::{CompactMaterial, InstructionSet, Layout, decode};
use sommerl_kernels::{CellLattice, Cubes, Factors, NodeSteps};

use crate::Error;
use crate::bytes::{Reader, crc32, hexadecimal, inflated};
use crate::json::notes_are_fine;
use crate::material::{Index, Material, Values};

/// What a file can hold.
const MOST_CELLS: u64 = 1 << 22;
const MOST_CLUSTERS: u32 = 1 << 16;
pub const LONGEST_FILE: usize = 2 * MOST_CELLS as usize + 24 * MOST_CLUSTERS as usize + (1 << 20);

/// Reads the head that all files have but libraries: magic, version, checksum.
pub fn read_head(reader: &mut Reader, magic: &[u8; 4], newest: u16) -> Result<u16, Error> {
    if reader.0.len() < 10 {
        return Err(Error::Truncated);
    }
    if reader.take(4)? != magic {
        return Err(Error::Kind);
    }
    let (version, crc) = (reader.u16()?, reader.u32()?);
    if !(1..=newest).contains(&version) {
        return Err(Error::Version);
    }
    if crc == crc32(reader.0) { Ok(version) } else { Err(Error::Checksum) }
}

/// The name of a material, and the SHA-256 of the file it was made from.
pub struct Origin {
    pub name: String,
    pub source_sha256: String,
}

impl Origin {
    pub fn read(reader: &mut Reader) -> Result<Origin, Error> {
        let length = reader.u8()?;
        let name = core::str::from_utf8(reader.take(length.into())?).map_err(|_| Error::Name)?;
        let length = reader.u8()?;
        if length != 0 && length != 32 {
            return Err(Error::Name);
        }
        Ok(Origin { name: name.into(), source_sha256: hexadecimal(reader.take(length.into())?) })
    }
}

/// A material from the bytes of a file.
pub fn read_smrl(bytes: &[u8]) -> Result<Material, Error> {
    if bytes.len() > LONGEST_FILE {
        return Err(Error::Contents);
    }
    let mut reader = Reader(bytes);
    let version = read_head(&mut reader, b"SMRL", 2)?;
    let kind = reader.u8()?;
    if kind > 1 || (kind == 0 && version != 1) {
        return Err(Error::Version);
    }
    let Origin { name, source_sha256 } = Origin::read(&mut reader)?;
    let length = reader.u16()?;
    let notes = core::str::from_utf8(reader.take(length.into())?).map_err(|_| Error::Notes)?;
    if !notes_are_fine(notes) {
        return Err(Error::Notes);
    }
    let made = if kind == 1 { read_nodes(&mut reader, version)? } else { read_cells(&mut reader)? };
    Ok(Material { name, source_sha256, notes: notes.into(), ..made })
}

fn read_nodes(reader: &mut Reader, version: u16) -> Result<Material, Error> {
    let scale = reader.f32()?;
    let flags = if version == 1 { 1 } else { reader.u8()? };
    if flags > 15 {
        return Err(Error::Contents);
    }
    let second = Layout::Second { reciprocal: flags & 1 != 0, mirrored: flags & 2 != 0 };
    let layout = if version == 1 { Layout::First } else { second };
    on_nodes(scale, flags, || Ok(decode(reader.0, layout, InstructionSet::fastest())?))
}

/// A compact material. flags: those of docs/format.md, of which the third and the fourth count. It has no name yet.
pub fn on_nodes(
    scale: f32,
    flags: u8,
    decoded: impl FnOnce() -> Result<CompactMaterial, Error>,
) -> Result<Material, Error> {
    if !(scale > 0.0 && scale.is_finite()) {
        return Err(Error::Contents);
    }
    let CompactMaterial { lattice, palette, gain, shape } = decoded()?;
    let steps = NodeSteps::new(&lattice).ok_or(sommerl_codec::Error::Lattice)?;
    let (gains, shapes) = (palette.gain_values(), palette.shape_values());
    let factors = Factors { gains: &gains, shapes: &shapes, gain: &gain, shape: &shape };
    let values = (0..steps.nodes()).map(|node| factors.value(node)).collect();
    let signed = flags & 4 != 0;
    let cubes = Cubes::new(scale.into(), signed, flags & 8 != 0);
    Ok(Material {
        name: String::new(),
        source_sha256: String::new(),
        notes: String::new(),
        reciprocal: lattice.reciprocal,
        mirrored: lattice.mirrored,
        signed,
        values: Values::Nodes(Box::new(steps), cubes, values),
    })
}

fn read_cells(reader: &mut Reader) -> Result<Material, Error> {
    let bins = [reader.u16()?, reader.u16()?, reader.u16()?];
    let (reciprocal, trilinear, clusters) = (reader.u8()?, reader.u8()?, reader.u32()?);
    let size: u64 = bins.iter().map(|&n| u64::from(n)).product();
    let fits = (1..=MOST_CELLS).contains(&size) && (1..=MOST_CLUSTERS).contains(&clusters);
    if !fits || reciprocal > 1 || trilinear > 1 {
        return Err(Error::Contents);
    }
    let lattice = CellLattice { bins: bins.map(usize::from), reciprocal: reciprocal == 1, trilinear: trilinear == 1 };
    let above = above_horizon(lattice);
    let cells: usize = above.iter().sum();
    if cells == 0 {
        return Err(Error::Contents);
    }
    let (entries, width) = (clusters as usize, if clusters <= 256 { 1 } else { 2 });
    let payload = inflated(reader.0, 24 * entries + width * cells)?;
    let mut reader = Reader(&payload);
    let lut = (0..3 * entries).map(|_| reader.f64()).collect::<Result<Vec<_>, _>>()?;
    let within = |value: &f64| (0.0..=f64::from(f32::MAX)).contains(value);
    if !lut.iter().all(within) {
        return Err(Error::Contents);
    }
    let index = if width == 1 {
        let index = filled(lattice, &above, reader.0.iter().copied());
        Index::Narrow(index.filter(|index| index.iter().all(|&n| usize::from(n) < entries)).ok_or(Error::Contents)?)
    } else {
        let pairs = reader.0.chunks_exact(2).map(|pair| u16::from_le_bytes([pair[0], pair[1]]));
        let index = filled(lattice, &above, pairs);
        Index::Wide(index.filter(|index| index.iter().all(|&n| usize::from(n) < entries)).ok_or(Error::Contents)?)
    };
    Ok(Material {
        name: String::new(),
        source_sha256: String::new(),
        notes: String::new(),
        reciprocal: lattice.reciprocal,
        mirrored: false,
        signed: false,
        values: Values::Cells(lattice, lut, index),
    })
}

/// For each column of cells (θ_h, φ_d), how many are above the horizon: the first few in θ_d.
fn above_horizon(lattice: CellLattice) -> Vec<usize> {
    let [a, b, c] = lattice.bins;
    let range = if lattice.reciprocal { PI } else { 2.0 * PI };
    let middle = |i: usize, n: usize| (i as f64 + 0.5) / n as f64;
    let theta_d: Vec<(f64, f64)> = (0..b).map(|j| (middle(j, b) * FRAC_PI_2).sin_cos()).collect();
    let tilt: Vec<f64> = (0..c).map(|k| (middle(k, c) * range).cos().abs()).collect();
    let mut counts = Vec::with_capacity(a * c);
    for i in 0..a {
        let (sin_h, cos_h) = (middle(i, a) * middle(i, a) * FRAC_PI_2).sin_cos();
        for tilt in &tilt {
            let above = |&(sin_d, cos_d): &(f64, f64)| cos_h * cos_d - sin_h * sin_d * tilt > 1e-12;
            counts.push(theta_d.iter().position(|d| !above(d)).unwrap_or(b));
        }
    }
    counts
}

/// The entries of all cells from those above the horizon. None if there are too few.
fn filled<Entry: Copy + Default>(
    lattice: CellLattice,
    above: &[usize],
    mut entries: impl Iterator<Item = Entry>,
) -> Option<Vec<Entry>> {
    let [a, b, c] = lattice.bins;
    let mut index = Vec::with_capacity(a * b * c);
    // For each φ_d, the last one above the horizon so far: in θ_d, or else the last in θ_h that has one.
    let mut last = vec![Entry::default(); c];
    for i in 0..a {
        for j in 0..b {
            for k in 0..c {
                if j < above[i * c + k] {
                    last[k] = entries.next()?;
                }
                index.push(last[k]);
            }
        }
    }
    Some(index)
}
