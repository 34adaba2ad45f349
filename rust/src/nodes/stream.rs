//! Lattice, palette and indices as one stream of the range coder: writing and reading are the same steps.

use super::model::Model;
use super::range::{Bits, Coder, Counter, Decoder, Encoder, FRESH};
use super::{Axes, FINE, Palette};
use crate::simd::Path;

pub const MOST_NODES: usize = 1 << 17;
pub const MOST_ENTRIES: usize = 1 << 10;
pub const MOST_BANDS: usize = 16;
const HIGHEST_GAIN: u32 = 1 << 12;
const WIDEST_SHAPE: i32 = 1 << 10;
/// Entries within reach, added up over all nodes: what the time of a decoder grows with.
const MOST_REACHED: usize = 1 << 26;
const REACHED_BY_ANY: usize = 1 << 22;
const REACHED_A_BYTE: usize = 1 << 11;

/// What a stream says.
pub struct Nodes {
    pub axes: Axes,
    pub palette: Palette,
    pub gain: Vec<u16>,
    pub shape: Vec<u16>,
}

type Found<T> = Result<T, String>;

/// path: changes nothing but the time.
pub fn encode(nodes: &Nodes, path: Path) -> Found<Vec<u8>> {
    let mut coder = Encoder::new();
    let axes = axes(&mut coder, Some(&nodes.axes))?;
    let palette = palette(&mut coder, Some(&nodes.palette))?;
    let (mut gain, mut shape) = (nodes.gain.clone(), nodes.shape.clone());
    let reached = indices(&mut coder, &axes, &palette, &mut gain, &mut shape, path, MOST_REACHED)?;
    let stream = coder.finish();
    within_reach(reached, most_reached(stream.len()))?;
    Ok(stream)
}

pub fn decode(data: &[u8], path: Path) -> Found<Nodes> {
    let mut coder = Decoder::new(data);
    let axes = axes(&mut coder, None)?;
    let palette = palette(&mut coder, None)?;
    let (mut gain, mut shape) = (vec![0; axes.nodes()], vec![0; axes.nodes()]);
    indices(&mut coder, &axes, &palette, &mut gain, &mut shape, path, most_reached(data.len()))?;
    if !coder.is_the_encoders() {
        return Err("expected a stream of nodes that ends with the file, found another".into());
    }
    Ok(Nodes { axes, palette, gain, shape })
}

/// Bits of all but the indices, and of the indices.
pub fn measure(nodes: &Nodes, path: Path) -> Found<(f64, f64)> {
    let mut coder = Counter(0.0);
    let axes = axes(&mut coder, Some(&nodes.axes))?;
    let palette = palette(&mut coder, Some(&nodes.palette))?;
    let head = coder.0;
    let (mut gain, mut shape) = (nodes.gain.clone(), nodes.shape.clone());
    indices(&mut coder, &axes, &palette, &mut gain, &mut shape, path, usize::MAX)?;
    Ok((head, coder.0 - head))
}

/// The bound on entries within reach for a stream of so many bytes: a few bytes do not keep a decoder busy for long.
fn most_reached(bytes: usize) -> usize {
    MOST_REACHED.min(REACHED_BY_ANY + REACHED_A_BYTE * bytes.min(MOST_REACHED / REACHED_A_BYTE))
}

#[inline(always)]
fn within_reach(reached: usize, most: usize) -> Found<usize> {
    if reached > most {
        return Err(format!("entries within reach: expected at most {most}, found more"));
    }
    Ok(reached)
}

/// Returns the number of entries within reach, of both palettes and added up over all nodes.
fn indices(
    coder: &mut impl Coder,
    axes: &Axes,
    palette: &Palette,
    gain: &mut [u16],
    shape: &mut [u16],
    path: Path,
    most: usize,
) -> Found<usize> {
    match path {
        Path::Portable => indices_inlined(coder, axes, palette, gain, shape, most),
        // SAFETY: the processor has what `Path::available` lists; with AVX-512 comes AVX2.
        #[cfg(target_arch = "x86_64")]
        Path::Avx2 | Path::Avx512 => unsafe { indices_avx2(coder, axes, palette, gain, shape, most) },
    }
}

/// The same steps with wider vectors, and so with the same result.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
unsafe fn indices_avx2(
    coder: &mut impl Coder,
    axes: &Axes,
    palette: &Palette,
    gain: &mut [u16],
    shape: &mut [u16],
    most: usize,
) -> Found<usize> {
    indices_inlined(coder, axes, palette, gain, shape, most)
}

#[inline(always)]
fn indices_inlined(
    coder: &mut impl Coder,
    axes: &Axes,
    palette: &Palette,
    gain: &mut [u16],
    shape: &mut [u16],
    most: usize,
) -> Found<usize> {
    let mut model = Model::new(axes, palette);
    let mut first = 0;
    for row in 0..axes.band.len() {
        model.begin(row);
        let width = axes.width(row);
        for at in 0..axes.nodes_in(row) {
            model.expect(at / width, at % width);
            let i = first + at;
            let (g, s) = model.node(coder, at, gain[i].into(), shape[i].into());
            (gain[i], shape[i]) = (g as u16, s as u16);
            found(coder)?;
            within_reach(model.reached(), most)?;
        }
        first += axes.nodes_in(row);
    }
    Ok(model.reached())
}

/// Whether the symbols that a decoder has found so far were any.
#[inline(always)]
fn found(coder: &impl Coder) -> Found<()> {
    if coder.lost() {
        return Err("stream: expected symbols of the range coder, found a code beyond all of them".into());
    }
    Ok(())
}

/// A number that was written or read, if it lies within its bounds.
fn bounded(coder: &impl Coder, what: &str, value: i64, least: i64, most: i64) -> Found<i64> {
    found(coder)?;
    if !(least..=most).contains(&value) {
        return Err(format!("{what}: expected {least} to {most}, found {value}"));
    }
    Ok(value)
}

fn axes(coder: &mut impl Coder, known: Option<&Axes>) -> Found<Axes> {
    let (mut counts, mut steps) = (FRESH, [FRESH; 3]);
    let bands = 1 + coder.number(known.map_or(0, |a| a.theta_d.len() as u32 - 1), &mut counts);
    let bands = bounded(coder, "bands", bands.into(), 1, MOST_BANDS as i64)? as usize;
    let theta_h = axis(coder, known.map(|a| &a.theta_h[..]), true, &mut counts, &mut steps[0])?;
    let mut band = Vec::new();
    for b in 0..bands {
        let left = theta_h.len() - band.len();
        let rows = if b + 1 == bands {
            left
        } else {
            1 + coder.number(
                known.map_or(0, |a| a.band.iter().filter(|&&x| x as usize == b).count() as u32 - 1),
                &mut counts,
            ) as usize
        };
        bounded(coder, "rows of a band", rows as i64, 1, left as i64)?;
        band.extend(std::iter::repeat_n(b as u8, rows));
    }
    let (mut theta_d, mut phi_d) = (Vec::new(), Vec::new());
    for b in 0..bands {
        theta_d.push(axis(coder, known.map(|a| &a.theta_d[b][..]), true, &mut counts, &mut steps[1])?);
        phi_d.push(axis(coder, known.map(|a| &a.phi_d[b][..]), false, &mut counts, &mut steps[2])?);
    }
    let axes = Axes { theta_h, band, theta_d, phi_d };
    bounded(coder, "nodes", axes.nodes() as i64, 1, MOST_NODES as i64)?;
    Ok(axes)
}

/// An axis that starts at 0; closed ones end at FINE, the others before.
fn axis(
    coder: &mut impl Coder,
    known: Option<&[u8]>,
    closed: bool,
    counts: &mut Bits,
    steps: &mut Bits,
) -> Found<Vec<u8>> {
    let inner = coder.number(known.map_or(0, |a| (a.len() - 1 - usize::from(closed)) as u32), counts);
    let mut places = vec![0];
    for i in 0..inner as usize {
        let before = u32::from(places[i]);
        let place = before + 1 + coder.number(known.map_or(0, |a| u32::from(a[i + 1]) - before - 1), steps);
        places.push(bounded(coder, "axis", place.into(), 1, i64::from(FINE) - 1)? as u8);
    }
    if closed {
        places.push(FINE);
    }
    Ok(places)
}

fn palette(coder: &mut impl Coder, known: Option<&Palette>) -> Found<Palette> {
    let (mut counts, mut steps) = (FRESH, [FRESH; 3]);
    let gains = count(coder, known.map(|p| p.gains.len()), "gains", &mut counts)?;
    let shapes = count(coder, known.map(|p| p.shapes.len()), "shapes", &mut counts)?;
    let mut codes: Vec<u32> = Vec::with_capacity(gains);
    for i in 0..gains {
        let least = codes.last().map_or(0, |code| code + 1);
        let code = least + coder.number(known.map_or(0, |p| p.gains[i] - least), &mut steps[0]);
        bounded(coder, "gain", code.into(), 0, i64::from(HIGHEST_GAIN) - 1)?;
        codes.push(code);
    }
    let (mut places, mut before) = (Vec::with_capacity(shapes), [-WIDEST_SHAPE, 0]);
    for i in 0..shapes {
        let step = known.map_or([0, 0], |p| [0, 1].map(|axis| p.shapes[i][axis] - before[axis]));
        let widest = i64::from(WIDEST_SHAPE);
        before[0] += coder.number(step[0] as u32, &mut steps[1]) as i32;
        bounded(coder, "shape", before[0].into(), -widest, widest)?;
        before[1] += coder.signed(step[1], &mut steps[2]);
        bounded(coder, "shape", before[1].into(), -widest, widest)?;
        places.push(before);
    }
    Ok(Palette { gains: codes, shapes: places })
}

/// Whether a palette can be written.
pub fn check(palette: &Palette) -> Found<()> {
    let (gains, shapes) = (&palette.gains, &palette.shapes);
    if ![gains.len(), shapes.len()].iter().all(|entries| (1..=MOST_ENTRIES).contains(entries)) {
        return Err(format!("palette: expected 1 to {MOST_ENTRIES} gains and shapes"));
    }
    let increasing = gains.windows(2).all(|pair| pair[0] < pair[1]) && gains[gains.len() - 1] < HIGHEST_GAIN;
    let ordered = shapes.windows(2).all(|pair| pair[0][0] <= pair[1][0]);
    if !increasing || !ordered || shapes.iter().flatten().any(|x| x.abs() > WIDEST_SHAPE) {
        return Err("palette: expected codes in order and within their bounds, found others".into());
    }
    Ok(())
}

fn count(coder: &mut impl Coder, known: Option<usize>, name: &str, bits: &mut Bits) -> Found<usize> {
    let entries = 1 + coder.number(known.map_or(0, |n| n as u32 - 1), bits);
    Ok(bounded(coder, name, entries.into(), 1, MOST_ENTRIES as i64)? as usize)
}
