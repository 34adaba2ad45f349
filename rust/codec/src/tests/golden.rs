//! The streams of files that were written once, ../../../../tests/golden/nodes*.smrl: what they mean, and what is left of them when
//! they are changed. Each check is also run on something that it has to refuse.

use crate::stream::encode_as;
use crate::{CompactMaterial, Error, InstructionSet, Layout, decode, measure};

/// A file, and what it says before its stream.
type Golden = (&'static [u8], Layout);

const FIRST: Golden = (include_bytes!("../../../../tests/golden/nodes.smrl"), Layout::First);
const SECOND: [Golden; 4] = [
    (include_bytes!("../../../../tests/golden/nodes-2-reciprocal.smrl"), second(true, false)),
    (include_bytes!("../../../../tests/golden/nodes-2-mirrored.smrl"), second(false, true)),
    (include_bytes!("../../../../tests/golden/nodes-2-both.smrl"), second(true, true)),
    (include_bytes!("../../../../tests/golden/nodes-2-neither.smrl"), second(false, false)),
];

const fn second(reciprocal: bool, mirrored: bool) -> Layout {
    Layout::Second { reciprocal, mirrored }
}

fn all() -> impl Iterator<Item = (&'static [u8], Layout)> {
    [FIRST].into_iter().chain(SECOND).map(|golden| (stream(golden), golden.1))
}

/// The stream: what comes after magic, version, checksum, kind, name, source, notes, scale and, in format 2, flags.
fn stream((file, layout): Golden) -> &'static [u8] {
    let mut at = 11;
    at += 1 + usize::from(file[at]);
    at += 1 + usize::from(file[at]);
    at += 2 + usize::from(u16::from_le_bytes([file[at], file[at + 1]]));
    &file[at + 4 + usize::from(layout != Layout::First)..]
}

fn read(data: &[u8], layout: Layout) -> Result<CompactMaterial, Error> {
    decode(data, layout, InstructionSet::fastest())
}

/// Numbers in an order, in one number.
fn mixed(numbers: &[u16]) -> u64 {
    numbers.iter().fold(0xcbf2_9ce4_8422_2325, |mix, &n| (mix ^ u64::from(n)).wrapping_mul(0x0100_0000_01b3))
}

#[test]
fn golden_bytes_mean_what_they_meant() {
    for set in InstructionSet::available() {
        let CompactMaterial { lattice, palette, gain, shape } = decode(stream(FIRST), FIRST.1, set).unwrap();
        assert_eq!(lattice.theta_h, [0, 10, 41, 102, 108, 119, 137, 148, 157, 180]);
        assert_eq!(lattice.band, [0, 0, 0, 0, 1, 1, 1, 2, 2, 2]);
        assert_eq!(lattice.theta_d[1], [0, 85, 90, 100, 104, 180]);
        assert_eq!(lattice.phi_d[2], [0, 48, 79, 81, 92, 111, 140, 145, 160]);
        assert_eq!((lattice.reciprocal, lattice.mirrored), (true, false));
        assert_eq!((palette.gains.len(), palette.gains[0], palette.gains[23]), (24, 15, 3946));
        assert_eq!((palette.shapes.len(), palette.shapes[0], palette.shapes[19]), (20, [-73, -17], [87, -20]));
        assert_eq!((gain.len(), mixed(&gain)), (295, 13_956_675_907_303_864_690));
        assert_eq!((shape.len(), mixed(&shape)), (295, 3_077_851_287_756_070_471));
    }
}

/// The nodes in φ_d of all bands, the first gain, and the indices that the reader in plain Python finds.
type Meant = (&'static [&'static [u8]], i32, [u64; 2]);

#[rustfmt::skip]
const MEANT: [Meant; 4] = [
    (&[&[0, 78, 110, 133, 149], &[0, 44, 164], &[0, 16, 31, 97, 136]], 123, [6_247_533_400_597_209_575, 1_681_473_287_925_191_088]),
    (&[&[0, 1, 60, 137, 143, 163, 180], &[0, 111, 180], &[0]], -4003, [1_999_326_384_460_108_772, 5_267_828_826_568_512_864]),
    (&[&[0, 176, 180], &[0], &[0, 80, 165, 180]], -3653, [6_002_293_580_114_890_697, 11_400_899_552_279_556_633]),
    (&[&[0, 84], &[0, 19, 63, 75, 115], &[0, 34, 40, 69, 70, 71]], -3741, [531_010_732_848_588_668, 18_056_108_377_715_599_773]),
];

#[test]
fn golden_bytes_of_format_2_mean_what_they_meant() {
    for (golden, (phi_d, least, indices)) in SECOND.into_iter().zip(MEANT) {
        for set in InstructionSet::available() {
            let CompactMaterial { lattice, palette, gain, shape } = decode(stream(golden), golden.1, set).unwrap();
            assert_eq!(second(lattice.reciprocal, lattice.mirrored), golden.1);
            assert_eq!(lattice.phi_d, phi_d);
            assert_eq!(palette.gains[0], least);
            assert_eq!([mixed(&gain), mixed(&shape)], indices);
        }
    }
}

/// Whether a material gives these bytes.
fn gives(material: &CompactMaterial, stream: &[u8], layout: Layout) -> bool {
    InstructionSet::available().all(|set| encode_as(layout, material, None, set).is_ok_and(|data| data == stream))
}

#[test]
fn what_is_written_are_the_golden_bytes() {
    for (stream, layout) in all() {
        let mut material = read(stream, layout).unwrap();
        assert!(gives(&material, stream, layout));
        if layout != Layout::First {
            let (head, indices) = measure(&material, None, InstructionSet::fastest()).unwrap();
            assert!((head + indices - 8.0 * stream.len() as f64).abs() < 32.0);
        }
        material.gain[40] ^= 1;
        assert!(!gives(&material, stream, layout));
    }
}

/// Whether bytes are refused, or are the one stream of what they mean.
fn refused_or_the_only_stream(
    data: &[u8],
    layout: Layout,
    read: impl Fn(&[u8], Layout) -> Result<CompactMaterial, Error>,
) -> bool {
    match read(data, layout) {
        Ok(found) => encode_as(layout, &found, None, InstructionSet::fastest()).is_ok_and(|again| again == data),
        Err(_) => true,
    }
}

/// A reader that does not mind zeros at the end.
fn careless(data: &[u8], layout: Layout) -> Result<CompactMaterial, Error> {
    let end = data.iter().rposition(|&byte| byte != 0).map_or(0, |last| last + 1);
    read(&data[..end], layout)
}

#[test]
fn every_length_and_every_changed_byte() {
    for (data, layout) in all() {
        for length in 0..data.len() {
            assert!(refused_or_the_only_stream(&data[..length], layout, read), "{length}");
        }
        for at in 0..data.len() {
            for change in [0x01, 0x41, 0x80, 0xff] {
                let mut changed = data.to_vec();
                changed[at] ^= change;
                assert!(refused_or_the_only_stream(&changed, layout, read), "{at}");
            }
        }
        let longer = [data, b"\0"].concat();
        assert!(refused_or_the_only_stream(&longer, layout, read));
        assert!(!refused_or_the_only_stream(&longer, layout, careless));
    }
}

#[test]
fn any_bytes() {
    let mut state = 1_u64;
    let mut byte = || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 56) as u8
    };
    for _ in 0..3_000 {
        let length = byte() % 40;
        let data: Vec<u8> = (0..length).map(|_| byte()).collect();
        for (_, layout) in all() {
            assert!(refused_or_the_only_stream(&data, layout, read), "{data:?}");
        }
    }
}
