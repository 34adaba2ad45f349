//! Streams that no encoder writes, and materials that are none: one test for each `Error`. Each check is also run on something that
//! it has to refuse.

mod golden;

use crate::range_coder::{BitCounter, Coder, Context, Decoder, Encoder, FRESH};
use crate::{
    CompactMaterial, Error, InstructionSet, Layout, NodeLattice, Palette, Prior, decode, decode_part, encode,
    encode_part, learnt, measure,
};

const SET: InstructionSet = InstructionSet::PORTABLE;
const RECIPROCAL: Layout = Layout::Second { reciprocal: true, mirrored: false };
const MIRRORED: Layout = Layout::Second { reciprocal: false, mirrored: true };

/// Codes of gains and shapes, each with the number of its context.
type Codes<'a> = &'a [(u32, usize)];

/// The numbers at the start of a stream, as they are coded.
struct Numbers<'a> {
    bands: u32,
    /// Inner nodes of θ_h, and the steps between them; likewise for θ_d and φ_d of each band.
    theta_h: &'a [u32],
    rows: &'a [u32],
    axes: &'a [&'a [u32]],
    gains: u32,
    shapes: u32,
    codes: Codes<'a>,
    layout: Layout,
}

const SHORT: Numbers = Numbers {
    bands: 1,
    theta_h: &[0],
    rows: &[],
    axes: &[&[0], &[0]],
    gains: 1,
    shapes: 1,
    codes: &GOOD,
    layout: Layout::First,
};
const GOOD: [(u32, usize); 3] = [(4095, 0), (0, 1), (0, 2)];

impl Numbers<'_> {
    fn axis(encoder: &mut Encoder, numbers: &[u32], counts: &mut Context, steps: &mut Context) {
        encoder.number(numbers[0], counts);
        numbers[1..].iter().for_each(|&step| {
            encoder.number(step, steps);
        });
    }

    /// The stream: where a decoder asks for more than these numbers, it finds the symbols that are first in their order.
    fn written(&self) -> Vec<u8> {
        let (mut encoder, mut counts, mut steps) = (Encoder::new(), FRESH, [FRESH; 3]);
        encoder.number(self.bands - 1, &mut counts);
        Self::axis(&mut encoder, self.theta_h, &mut counts, &mut steps[0]);
        for &rows in self.rows {
            encoder.number(rows - 1, &mut counts);
        }
        for (i, axis) in self.axes.iter().enumerate() {
            Self::axis(&mut encoder, axis, &mut counts, &mut steps[1 + i % 2]);
        }
        let (mut counts, mut steps) = (FRESH, [FRESH; 3]);
        encoder.number(self.gains - 1, &mut counts);
        encoder.number(self.shapes - 1, &mut counts);
        for &(code, context) in self.codes {
            encoder.number(code, &mut steps[context]);
        }
        encoder.finish()
    }

    fn error(&self) -> Option<Error> {
        decode(&self.written(), self.layout, SET).err()
    }
}

/// Inner nodes of an axis that has all places from 0.
fn full(inner: usize) -> Vec<u32> {
    [vec![inner as u32], vec![0; inner]].concat()
}

fn small() -> CompactMaterial {
    CompactMaterial {
        lattice: NodeLattice {
            theta_h: vec![0, 30, 180],
            band: vec![0, 1, 1],
            theta_d: vec![vec![0, 180], vec![0, 90, 180]],
            phi_d: vec![vec![0, 90], vec![0]],
            reciprocal: true,
            mirrored: false,
        },
        palette: Palette { gains: vec![-1, 2, 4095], shapes: vec![[-1024, 3], [0, 0], [0, -1024]] },
        gain: vec![0, 1, 2, 0, 1, 2, 0, 1, 2, 0],
        shape: vec![2, 1, 0, 2, 1, 0, 2, 1, 0, 2],
    }
}

#[test]
fn numbers_beyond_their_bounds_are_refused() {
    let too_many: Vec<u32> = full(180);
    let wide = full(64);
    let cases: [(Numbers, Error, &str); 14] = [
        (Numbers { bands: 17, ..SHORT }, Error::Bands(17), "bands: expected 1 to 16, found 17"),
        (Numbers { bands: (1 << 21) - 1, ..SHORT }, Error::Bands(2097151), "bands: expected 1 to 16, found 2097151"),
        (Numbers { theta_h: &[1, 179], ..SHORT }, Error::Axis(180), "axis: expected 1 to 179, found 180"),
        (Numbers { theta_h: &too_many, ..SHORT }, Error::Axis(180), "axis: expected 1 to 179, found 180"),
        (Numbers { theta_h: &[1, 2097150], ..SHORT }, Error::Axis(2097151), "axis: expected 1 to 179, found 2097151"),
        (Numbers { axes: &[&[1, 179]], ..SHORT }, Error::Axis(180), "axis: expected 1 to 179, found 180"),
        (Numbers { axes: &[&[0], &[1, 179]], ..SHORT }, Error::Axis(180), "axis: expected 1 to 179, found 180"),
        (
            Numbers { bands: 2, rows: &[3], ..SHORT },
            Error::RowsOfBand { left: 2, found: 3 },
            "rows of a band: expected 1 to 2, found 3",
        ),
        (
            Numbers { bands: 2, rows: &[2], ..SHORT },
            Error::RowsOfBand { left: 0, found: 0 },
            "rows of a band: expected 1 to 0, found 0",
        ),
        (
            Numbers { theta_h: &full(62), axes: &[&wide, &wide], ..SHORT },
            Error::Nodes(64 * 66 * 65),
            "nodes: expected 1 to 131072, found 274560",
        ),
        (Numbers { gains: 1025, ..SHORT }, Error::Gains(1025), "gains: expected 1 to 1024, found 1025"),
        (Numbers { shapes: 1025, ..SHORT }, Error::Shapes(1025), "shapes: expected 1 to 1024, found 1025"),
        (
            Numbers { codes: &[(4095, 0), (2049, 1)], ..SHORT },
            Error::ShapeCode(1025),
            "shape: expected -1024 to 1024, found 1025",
        ),
        (
            Numbers { codes: &[(4095, 0), (0, 1), (2049, 2)], ..SHORT },
            Error::ShapeCode(-1025),
            "shape: expected -1024 to 1024, found -1025",
        ),
    ];
    for (numbers, error, sentence) in cases {
        for layout in [Layout::First, RECIPROCAL] {
            assert_eq!(Numbers { layout, ..numbers }.error(), Some(error));
        }
        assert_eq!(error.to_string(), sentence);
    }
    assert!(!matches!(
        SHORT.error(),
        Some(Error::Bands(_) | Error::Axis(_) | Error::GainCode { .. } | Error::ShapeCode(_))
    ));
}

#[test]
fn gains_beyond_their_bounds_are_refused() {
    // The first one is a number in format 1, and has a sign in format 2.
    let cases: [(Layout, Codes, i64, &str); 6] = [
        (Layout::First, &[(4096, 0)], 4096, "gain: expected 0 to 4095, found 4096"),
        (Layout::First, &[(4095, 0), (0, 0)], 4096, "gain: expected 0 to 4095, found 4096"),
        (RECIPROCAL, &[(8192, 0)], 4096, "gain: expected -4095 to 4095, found 4096"),
        (RECIPROCAL, &[(8191, 0)], -4096, "gain: expected -4095 to 4095, found -4096"),
        (MIRRORED, &[(8190, 0), (0, 0)], 4096, "gain: expected -4095 to 4095, found 4096"),
        (MIRRORED, &[(8189, 0), (8191, 0)], 4097, "gain: expected -4095 to 4095, found 4097"),
    ];
    for (layout, codes, found, sentence) in cases {
        let least = if layout == Layout::First { 0 } else { -4095 };
        let error = Error::GainCode { least, found };
        assert_eq!(Numbers { gains: codes.len() as u32, codes, layout, ..SHORT }.error(), Some(error));
        assert_eq!(error.to_string(), sentence);
    }
}

#[test]
fn places_beyond_the_end_of_a_folded_axis_are_refused() {
    let error = |phi_d| Numbers { axes: &[&[0], phi_d], layout: MIRRORED, ..SHORT }.error();
    for phi_d in [&[2, 179][..], &[182, 178, 0], &[(1 << 21) - 2, 179]] {
        assert_eq!(error(phi_d), Some(Error::Axis(180)));
    }
    for phi_d in [&[0][..], &[1], &[2, 178]] {
        assert!(matches!(error(phi_d), None | Some(Error::OtherStream)));
    }
}

#[test]
fn numbers_at_their_bounds_are_not_refused() {
    let shapes = [(4095, 0), (2048, 1), (2048, 2)];
    for numbers in [SHORT, Numbers { theta_h: &[1, 178], ..SHORT }, Numbers { codes: &shapes, ..SHORT }] {
        assert!(matches!(numbers.error(), None | Some(Error::OtherStream)), "{:?}", numbers.error());
    }
    for code in [8189, 8190] {
        let error = Numbers { codes: &[(code, 0), (0, 1), (0, 2)], layout: RECIPROCAL, ..SHORT }.error();
        assert!(matches!(error, None | Some(Error::OtherStream)), "{error:?}");
    }
}

#[test]
fn a_few_bytes_keep_no_decoder_busy() {
    let (rows, planes, turns) = (full(30), full(62), full(63));
    let codes = [vec![(0, 0); 1024], [(0, 1), (0, 2)].repeat(1024)].concat();
    let numbers =
        Numbers { theta_h: &rows, axes: &[&planes, &turns], gains: 1024, shapes: 1024, codes: &codes, ..SHORT };
    let most = (1 << 22) + (1 << 11) * numbers.written().len();
    assert!(numbers.written().len() < 200);
    for layout in [Layout::First, RECIPROCAL] {
        assert_eq!(Numbers { layout, ..numbers }.error(), Some(Error::Reached(most)));
    }
    let sentence = format!("entries within reach: expected at most {most}, found more");
    assert_eq!(Error::Reached(most).to_string(), sentence);
}

#[test]
fn a_code_beyond_all_symbols_is_refused() {
    let found = (0..=255).filter_map(|byte| decode(&[0xff, 0xff, 0xff, byte], RECIPROCAL, SET).err());
    assert!(found.clone().any(|error| error == Error::NoSymbol), "{:?}", found.collect::<Vec<_>>());
    let sentence = "stream: expected symbols of the range coder, found a code beyond all of them";
    assert_eq!(Error::NoSymbol.to_string(), sentence);
}

#[test]
fn what_follows_the_end_is_refused() {
    let stream = encode(&small(), SET).unwrap();
    assert_eq!(decode(&stream, RECIPROCAL, SET).as_ref(), Ok(&small()));
    for after in [&b"\0"[..], b"\x01", &[0; 9]] {
        assert_eq!(decode(&[&stream, after].concat(), RECIPROCAL, SET), Err(Error::OtherStream));
    }
    assert_eq!(Error::OtherStream.to_string(), "expected a stream of nodes that ends with the file, found another");
}

/// What the writers say of a material after a change.
fn refusal(change: impl Fn(&mut CompactMaterial)) -> Option<Error> {
    let mut material = small();
    change(&mut material);
    let error = encode(&material, SET).err();
    assert_eq!(measure(&material, None, SET).err(), error);
    error
}

#[test]
fn lattices_that_are_none_are_not_written() {
    let changes: [fn(&mut NodeLattice); 13] = [
        |l| l.theta_h.clear(),
        |l| l.theta_h = vec![0, 30, 179],
        |l| l.theta_h = vec![1, 30, 180],
        |l| l.theta_h = vec![0, 0, 180],
        |l| l.band = vec![1, 0, 1],
        |l| l.band = vec![0, 0, 0],
        |l| l.band = vec![0, 1, 2],
        |l| l.band = vec![0, 1],
        |l| l.theta_d[1] = vec![0, 190, 180],
        |l| l.theta_d[0] = vec![0],
        |l| l.phi_d[0] = vec![0, 180],
        |l| l.phi_d.truncate(1),
        |l| l.mirrored = true,
    ];
    for change in changes {
        assert_eq!(refusal(|material| change(&mut material.lattice)), Some(Error::Lattice));
    }
    assert_eq!(refusal(|_| ()), None);
    assert_eq!(refusal(|material| material.lattice.reciprocal = false), None);
    for (phi_d, error) in [(vec![0, 180], None), (vec![0], Some(Error::Indices)), (vec![0, 60], Some(Error::Lattice))] {
        let folded = refusal(|material| {
            material.lattice.mirrored = true;
            material.lattice.phi_d[0].clone_from(&phi_d);
        });
        assert_eq!(folded, error);
    }
    assert_eq!(
        Error::Lattice.to_string(),
        "lattice: expected nodes that increase on each axis, and bands in order, found others"
    );
}

#[test]
fn more_nodes_and_bands_than_a_file_holds_are_not_written() {
    let axis: Vec<u8> = (0..=180).collect();
    let most = |rows: usize| NodeLattice {
        theta_h: axis[..rows - 1].iter().copied().chain([180]).collect(),
        band: vec![0; rows],
        theta_d: vec![axis[..63].iter().copied().chain([180]).collect()],
        phi_d: vec![axis[..64].to_vec()],
        reciprocal: true,
        mirrored: false,
    };
    assert_eq!(most(32).check(), Ok(()));
    assert_eq!(most(33).check(), Err(Error::Lattice));
    let bands = |count: usize| NodeLattice {
        theta_h: axis[..count - 1].iter().copied().chain([180]).collect(),
        band: (0..count as u8).collect(),
        theta_d: vec![vec![0, 180]; count],
        phi_d: vec![vec![0]; count],
        reciprocal: false,
        mirrored: true,
    };
    assert_eq!(bands(16).check(), Ok(()));
    assert_eq!(bands(17).check(), Err(Error::Lattice));
}

#[test]
fn palettes_that_are_none_are_not_written() {
    for (gains, shapes) in [(0, 1), (1, 0), (1025, 1), (1, 1025)] {
        let palette = Palette { gains: (0..gains).collect(), shapes: vec![[0, 0]; shapes] };
        assert_eq!(palette.check(), Err(Error::PaletteSize));
    }
    assert_eq!(Palette { gains: (0..1024).collect(), shapes: vec![[0, 0]; 1024] }.check(), Ok(()));
    assert_eq!(Error::PaletteSize.to_string(), "palette: expected 1 to 1024 gains and shapes");
    let changes: [fn(&mut Palette); 7] = [
        |p| p.gains = vec![4, 4, 5],
        |p| p.gains = vec![5, 4, 6],
        |p| p.gains = vec![1, 2, 4096],
        |p| p.gains = vec![-4096, 2, 3],
        |p| p.shapes[1] = [-1025, 0],
        |p| p.shapes[2] = [0, i32::MIN],
        |p| p.shapes[0] = [1, 0],
    ];
    for change in changes {
        assert_eq!(refusal(|material| change(&mut material.palette)), Some(Error::PaletteCodes));
    }
    assert_eq!(
        Error::PaletteCodes.to_string(),
        "palette: expected codes in order and within their bounds, found others"
    );
}

#[test]
fn indices_that_do_not_fit_are_not_written() {
    let changes: [fn(&mut CompactMaterial); 4] =
        [|m| m.gain[3] = 3, |m| m.shape[9] = u16::MAX, |m| m.gain.push(0), |m| m.shape.clear()];
    for change in changes {
        assert_eq!(refusal(change), Some(Error::Indices));
    }
    assert_eq!(Error::Indices.to_string(), "expected an entry of the palette for each node");
}

/// Whether a decoder reads the numbers that an encoder wrote, and a counter finds how many bits they took.
fn reads_back(written: &[i32], expected: &[i32]) -> bool {
    let (mut encoder, mut counter, mut contexts) = (Encoder::new(), BitCounter(0.0), [FRESH; 3]);
    for &number in written {
        encoder.signed(number, &mut contexts[0]);
        counter.signed(number, &mut contexts[1]);
    }
    let stream = encoder.finish();
    let mut decoder = Decoder::new(&stream);
    let same = expected.iter().all(|&number| decoder.signed(0, &mut contexts[2]) == number);
    same && !decoder.lost() && decoder.is_the_encoders() && (8.0 * stream.len() as f64 - counter.0).abs() < 32.0
}

#[test]
fn numbers_of_either_sign() {
    let numbers = [0, -1, 1, -2, 2, 7, -8, 100, -100, 1 << 19, -(1 << 19), 1048574, -1048575, 0, 0, 0];
    assert!(reads_back(&numbers, &numbers));
    assert!(!reads_back(&numbers, &[&[1], &numbers[1..]].concat()));
    assert!(!reads_back(&numbers, &numbers[..9]));
}

/// Whether a part is read as the material, with a prior.
fn reads(part: &[u8], prior: &Prior) -> bool {
    decode_part(part, &small().lattice, prior, SET) == Ok(small())
}

#[test]
fn parts_leave_out_the_lattice_and_begin_with_what_was_learnt() {
    let prior = learnt(&small(), None).unwrap();
    let part = encode_part(&small(), &prior, SET).unwrap();
    assert!(reads(&part, &prior));
    let other = Prior { levels: prior.levels.map(|level| 9.0 * level), ..prior.clone() };
    assert!(!reads(&part, &other));
    for set in InstructionSet::available() {
        assert_eq!(encode_part(&small(), &prior, set).as_ref(), Ok(&part));
    }
    let (head, indices) = measure(&small(), Some(&prior), SET).unwrap();
    assert!(((head + indices) / 8.0 - part.len() as f64).abs() < 4.0);
    let whole = encode(&small(), SET).unwrap();
    assert!(part.len() < whole.len());
}

#[test]
fn parts_that_no_encoder_writes_are_refused() {
    let prior = learnt(&small(), None).unwrap();
    let part = encode_part(&small(), &prior, SET).unwrap();
    for length in 0..part.len() {
        assert!(!reads(&part[..length], &prior));
    }
    for after in [&b"\0"[..], b"\x01"] {
        let found = decode_part(&[&part, after].concat(), &small().lattice, &prior, SET);
        assert_eq!(found, Err(Error::OtherStream));
    }
    let mut broken = small();
    broken.gain.pop();
    assert_eq!(encode_part(&broken, &prior, SET), Err(Error::Indices));
    assert_eq!(learnt(&broken, None), Err(Error::Indices));
    let lattice = NodeLattice { theta_h: vec![1, 180], ..small().lattice };
    assert_eq!(decode_part(&part, &lattice, &prior, SET), Err(Error::Lattice));
}
