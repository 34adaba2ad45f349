//! Lattice, palette and indices as one stream of the range coder. Each part is one function for writing and for reading, which
//! calls the coder in the order of docs/format.md; see `Coder`.

use sommerl_simd::{InstructionSet, for_each_instruction_set};

use crate::error::Error;
use crate::lattice::{FINE, MOST_BANDS, MOST_NODES, NodeLattice};
use crate::model::{Model, Prior};
use crate::palette::{HIGHEST_GAIN, MOST_ENTRIES, Palette, WIDEST_SHAPE};
use crate::range_coder::{BitCounter, Coder, Context, Decoder, Encoder, FRESH};

/// Bounds on the entries within reach, added up over all nodes: the time that a decoder takes grows with them.
const MOST_REACHED: usize = 1 << 26;
const REACHED_BY_ANY: usize = 1 << 22;
const REACHED_A_BYTE: usize = 1 << 11;

/// The version of a stream, and which folds of φ_d its lattice has: what a file says before the stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layout {
    /// Format 1: reciprocal, not mirrored, and without negative gains. It is read, but not written any more.
    First,
    /// Format 2. The fields are those of the `NodeLattice`.
    Second {
        /// Whether both orders of the directions give the same.
        reciprocal: bool,
        /// Whether φ_d and −φ_d give the same.
        mirrored: bool,
    },
}

impl Layout {
    /// That in which a lattice is written.
    fn of(lattice: &NodeLattice) -> Layout {
        Layout::Second { reciprocal: lattice.reciprocal, mirrored: lattice.mirrored }
    }

    /// Whether lattices are reciprocal, and whether they are mirrored.
    fn folds(self) -> (bool, bool) {
        match self {
            Layout::First => (true, false),
            Layout::Second { reciprocal, mirrored } => (reciprocal, mirrored),
        }
    }
}

/// All of a compact material but its scale and whether its blended values keep their sign, which its file holds before the stream.
#[derive(Clone, Debug, PartialEq)]
pub struct CompactMaterial {
    /// Where the nodes are.
    pub lattice: NodeLattice,
    /// The gains and shapes that they choose from.
    pub palette: Palette,
    /// The number of each node's gain.
    pub gain: Vec<u16>,
    /// The number of each node's shape.
    pub shape: Vec<u16>,
}

impl CompactMaterial {
    /// Whether lattice and palette can be written and each node has a gain and a shape.
    fn check(&self) -> Result<(), Error> {
        self.lattice.check()?;
        self.palette.check()?;
        check_indices(&self.lattice, &self.palette, &self.gain, &self.shape)
    }
}

/// Whether each node of a lattice has a gain and a shape of a palette. Gives `Error::Indices` if not.
pub fn check_indices(lattice: &NodeLattice, palette: &Palette, gain: &[u16], shape: &[u16]) -> Result<(), Error> {
    let nodes = lattice.nodes();
    let fit = |index: &[u16], entries: usize| {
        index.len() == nodes && index.iter().all(|&number| usize::from(number) < entries)
    };
    let all = fit(gain, palette.gains.len()) && fit(shape, palette.shapes.len());
    if all { Ok(()) } else { Err(Error::Indices) }
}

/// The stream of a material, of format 2: the same bytes with every instruction set. Gives `Error::Lattice`, `Error::PaletteSize`,
/// `Error::PaletteCodes` or `Error::Indices` for what is no material of this format; and `Error::Reached` for one that no reader would
/// take, because it is too much work.
pub fn encode(material: &CompactMaterial, set: InstructionSet) -> Result<Vec<u8>, Error> {
    encode_as(Layout::of(&material.lattice), material, None, set)
}

/// The part of a material's stream that is its own where its lattice is shared and the model begins with a prior: the palette and
/// the indices. Gives the errors of `encode`.
pub fn encode_part(material: &CompactMaterial, prior: &Prior, set: InstructionSet) -> Result<Vec<u8>, Error> {
    encode_as(Layout::of(&material.lattice), material, Some(prior), set)
}

/// Either of them, in any layout that the material fits. With a prior, it is a part.
pub(crate) fn encode_as(
    layout: Layout,
    material: &CompactMaterial,
    prior: Option<&Prior>,
    set: InstructionSet,
) -> Result<Vec<u8>, Error> {
    material.check()?;
    let mut coder = Encoder::new();
    if prior.is_none() {
        lattice(&mut coder, layout, Some(&material.lattice))?;
    }
    let palette = palette(&mut coder, layout, Some(&material.palette))?;
    let (mut gain, mut shape) = (material.gain.clone(), material.shape.clone());
    let reached = indices(set, &mut coder, &material.lattice, &palette, prior, &mut gain, &mut shape, MOST_REACHED)?;
    let stream = coder.finish();
    within_reach(reached, most_reached(stream.len()))?;
    Ok(stream)
}

/// The material of a stream. Gives an error for every stream that is not the only one of a material, and neither panics nor takes
/// long for any bytes.
pub fn decode(data: &[u8], layout: Layout, set: InstructionSet) -> Result<CompactMaterial, Error> {
    let mut coder = Decoder::new(data);
    let lattice = lattice(&mut coder, layout, None)?;
    rest(coder, data.len(), layout, lattice, None, set)
}

/// The material of a part, on the lattice that is shared. Gives an error for every part that is not the only one of a material, and
/// neither panics nor takes long for any bytes; `Error::Lattice` for a lattice that no file can hold.
pub fn decode_part(
    data: &[u8],
    lattice: &NodeLattice,
    prior: &Prior,
    set: InstructionSet,
) -> Result<CompactMaterial, Error> {
    lattice.check()?;
    rest(Decoder::new(data), data.len(), Layout::of(lattice), lattice.clone(), Some(prior), set)
}

/// The material of a stream of so many bytes, of which the lattice has been read, or is shared.
fn rest(
    mut coder: Decoder,
    bytes: usize,
    layout: Layout,
    lattice: NodeLattice,
    prior: Option<&Prior>,
    set: InstructionSet,
) -> Result<CompactMaterial, Error> {
    let palette = palette(&mut coder, layout, None)?;
    let (mut gain, mut shape) = (vec![0; lattice.nodes()], vec![0; lattice.nodes()]);
    indices(set, &mut coder, &lattice, &palette, prior, &mut gain, &mut shape, most_reached(bytes))?;
    if !coder.is_the_encoders() {
        return Err(Error::OtherStream);
    }
    Ok(CompactMaterial { lattice, palette, gain, shape })
}

/// How many bits the stream of a material takes: for lattice and palette, and for the indices; with a prior, those of its part. Gives
/// the errors of `encode` for what is no material of this format.
pub fn measure(material: &CompactMaterial, prior: Option<&Prior>, set: InstructionSet) -> Result<(f64, f64), Error> {
    material.check()?;
    let (mut coder, layout) = (BitCounter(0.0), Layout::of(&material.lattice));
    if prior.is_none() {
        lattice(&mut coder, layout, Some(&material.lattice))?;
    }
    let palette = palette(&mut coder, layout, Some(&material.palette))?;
    let head = coder.0;
    let (mut gain, mut shape) = (material.gain.clone(), material.shape.clone());
    indices(set, &mut coder, &material.lattice, &palette, prior, &mut gain, &mut shape, usize::MAX)?;
    Ok((head, coder.0 - head))
}

/// What the model has learnt when it has seen a whole material. Gives the errors of `encode`.
pub fn learnt(material: &CompactMaterial, prior: Option<&Prior>) -> Result<Prior, Error> {
    material.check()?;
    let CompactMaterial { lattice, palette, gain, shape } = material;
    let (mut model, mut first) = (Model::new(lattice, palette, prior), 0);
    for row in 0..lattice.band.len() {
        model.begin(row);
        for at in 0..lattice.nodes_in(row) {
            model.expect(at / lattice.width(row), at % lattice.width(row));
            model.update(at, gain[first + at].into(), shape[first + at].into());
        }
        first += lattice.nodes_in(row);
    }
    Ok(model.learnt())
}

/// The bound on entries within reach for a stream of so many bytes: a few bytes cannot keep a decoder busy for long.
fn most_reached(bytes: usize) -> usize {
    MOST_REACHED.min(REACHED_BY_ANY + REACHED_A_BYTE * bytes.min(MOST_REACHED / REACHED_A_BYTE))
}

#[inline(always)]
fn within_reach(reached: usize, most: usize) -> Result<(), Error> {
    if reached > most { Err(Error::Reached(most)) } else { Ok(()) }
}

// The loops are short and full of divisions: AVX-512 has not been shown to be faster than AVX2 for them.
for_each_instruction_set! { up to avx2:
    /// Writes or reads each node's gain and shape. Returns the number of entries within reach, of both palettes and added up over
    /// all nodes.
    #[allow(clippy::too_many_arguments)] // each is one of the model's or of the stream's own
    fn indices<C: Coder>(
        coder: &mut C,
        lattice: &NodeLattice,
        palette: &Palette,
        prior: Option<&Prior>,
        gain: &mut [u16],
        shape: &mut [u16],
        most_reached: usize,
    ) -> Result<usize, Error> {
        let mut model = Model::new(lattice, palette, prior);
        let mut first = 0;
        for row in 0..lattice.band.len() {
            model.begin(row);
            let width = lattice.width(row);
            for at in 0..lattice.nodes_in(row) {
                model.expect(at / width, at % width);
                let i = first + at;
                let g = coder.pick(gain[i].into(), model.gain_weights());
                let s = coder.pick(shape[i].into(), model.shape_weights());
                model.update(at, g, s);
                (gain[i], shape[i]) = (g as u16, s as u16);
                symbols(coder)?;
                within_reach(model.reached(), most_reached)?;
            }
            first += lattice.nodes_in(row);
        }
        Ok(model.reached())
    }
}

/// Whether all that was read so far were symbols.
#[inline(always)]
fn symbols(coder: &impl Coder) -> Result<(), Error> {
    if coder.lost() { Err(Error::NoSymbol) } else { Ok(()) }
}

/// A number that was written or read, if it lies within its bounds; otherwise `error` of it.
fn bounded(
    coder: &impl Coder,
    value: impl Into<i64>,
    bounds: impl std::ops::RangeBounds<i64>,
    error: impl Fn(i64) -> Error,
) -> Result<i64, Error> {
    symbols(coder)?;
    let value = value.into();
    if bounds.contains(&value) { Ok(value) } else { Err(error(value)) }
}

/// Writes the lattice that is known, or reads one if none is.
fn lattice(coder: &mut impl Coder, layout: Layout, known: Option<&NodeLattice>) -> Result<NodeLattice, Error> {
    let (mut counts, mut steps) = (FRESH, [FRESH; 3]);
    let (reciprocal, mirrored) = layout.folds();
    let end = if mirrored { End::Folded } else { End::Open };
    let bands = 1 + coder.number(known.map_or(0, |l| l.theta_d.len() as u32 - 1), &mut counts);
    let bands = bounded(coder, bands, 1..=MOST_BANDS as i64, Error::Bands)? as usize;
    let theta_h = axis(coder, known.map(|l| &l.theta_h[..]), End::Closed, &mut counts, &mut steps[0])?;
    let mut band = Vec::new();
    for b in 0..bands {
        let left = theta_h.len() as i64 - band.len() as i64;
        let rows = if b + 1 == bands {
            left
        } else {
            let rows_of = |l: &NodeLattice| l.band.iter().filter(|&&other| usize::from(other) == b).count();
            i64::from(1 + coder.number(known.map_or(0, |l| rows_of(l) as u32 - 1), &mut counts))
        };
        let rows = bounded(coder, rows, 1..=left, |found| Error::RowsOfBand { left, found })?;
        band.extend(std::iter::repeat_n(b as u8, rows as usize));
    }
    let (mut theta_d, mut phi_d) = (Vec::new(), Vec::new());
    for b in 0..bands {
        theta_d.push(axis(coder, known.map(|l| &l.theta_d[b][..]), End::Closed, &mut counts, &mut steps[1])?);
        phi_d.push(axis(coder, known.map(|l| &l.phi_d[b][..]), end, &mut counts, &mut steps[2])?);
    }
    let lattice = NodeLattice { theta_h, band, theta_d, phi_d, reciprocal, mirrored };
    bounded(coder, lattice.nodes() as i64, 1..=MOST_NODES as i64, Error::Nodes)?;
    Ok(lattice)
}

/// Where an axis, which starts at 0, ends.
#[derive(Clone, Copy, PartialEq)]
enum End {
    /// At FINE, which takes no bits.
    Closed,
    /// Before FINE.
    Open,
    /// At FINE, unless it is 0 alone.
    Folded,
}

/// An axis.
fn axis(
    coder: &mut impl Coder,
    known: Option<&[u8]>,
    end: End,
    counts: &mut Context,
    steps: &mut Context,
) -> Result<Vec<u8>, Error> {
    let counted = known.map_or(0, |axis| axis.len() - 1 - usize::from(end == End::Closed));
    let counted = coder.number(counted as u32, counts);
    let inner = if end == End::Folded { counted.saturating_sub(1) } else { counted };
    let mut places = vec![0];
    for i in 0..inner as usize {
        let before = u32::from(places[i]);
        let place = before + 1 + coder.number(known.map_or(0, |axis| u32::from(axis[i + 1]) - before - 1), steps);
        places.push(bounded(coder, place, 1..i64::from(FINE), Error::Axis)? as u8);
    }
    if end == End::Closed || inner < counted {
        places.push(FINE);
    }
    Ok(places)
}

/// Writes the palette that is known, or reads one if none is.
fn palette(coder: &mut impl Coder, layout: Layout, known: Option<&Palette>) -> Result<Palette, Error> {
    let (mut counts, mut steps) = (FRESH, [FRESH; 3]);
    let sizes = known.map_or([0, 0], |p| [p.gains.len() as u32 - 1, p.shapes.len() as u32 - 1]);
    let entries = 1..=MOST_ENTRIES as i64;
    let count = 1 + coder.number(sizes[0], &mut counts);
    let count = bounded(coder, count, entries.clone(), Error::Gains)? as usize;
    let shape_count = 1 + coder.number(sizes[1], &mut counts);
    let shape_count = bounded(coder, shape_count, entries, Error::Shapes)? as usize;
    let mut gains: Vec<i32> = Vec::with_capacity(count);
    let lowest = if layout == Layout::First { 0 } else { -HIGHEST_GAIN };
    for i in 0..count {
        let code = if i == 0 && layout != Layout::First {
            coder.signed(known.map_or(0, |p| p.gains[0]), &mut steps[0])
        } else {
            let least = gains.last().map_or(0, |code| code + 1);
            least + coder.number(known.map_or(0, |p| (p.gains[i] - least) as u32), &mut steps[0]) as i32
        };
        let least = i64::from(lowest);
        bounded(coder, code, least..=i64::from(HIGHEST_GAIN), |found| Error::GainCode { least, found })?;
        gains.push(code);
    }
    let widest = i64::from(WIDEST_SHAPE);
    let (mut shapes, mut code) = (Vec::with_capacity(shape_count), [-WIDEST_SHAPE, 0]);
    for i in 0..shape_count {
        let step = known.map_or([0, 0], |p| [0, 1].map(|axis| p.shapes[i][axis] - code[axis]));
        code[0] += coder.number(step[0] as u32, &mut steps[1]) as i32;
        bounded(coder, code[0], -widest..=widest, Error::ShapeCode)?;
        code[1] += coder.signed(step[1], &mut steps[2]);
        bounded(coder, code[1], -widest..=widest, Error::ShapeCode)?;
        shapes.push(code);
    }
    Ok(Palette { gains, shapes })
}
