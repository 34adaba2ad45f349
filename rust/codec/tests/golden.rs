//! The stream of a file that was written once, ../../tests/golden/nodes.smrl: what it means, and what is left of it when it is
//! changed. Each check is also run on something that it has to refuse.

use sommerl_codec::{CompactMaterial, Error, InstructionSet, decode, encode, measure};

const FILE: &[u8] = include_bytes!("../../../tests/golden/nodes.smrl");

/// The stream: what comes after magic, version, checksum, kind, name, source, notes and scale.
fn stream() -> &'static [u8] {
    let mut at = 11;
    at += 1 + usize::from(FILE[at]);
    at += 1 + usize::from(FILE[at]);
    at += 2 + usize::from(u16::from_le_bytes([FILE[at], FILE[at + 1]]));
    &FILE[at + 4..]
}

fn read(data: &[u8]) -> Result<CompactMaterial, Error> {
    decode(data, InstructionSet::fastest())
}

/// Numbers in an order, in one number.
fn mixed(numbers: &[u16]) -> u64 {
    numbers.iter().fold(0xcbf2_9ce4_8422_2325, |mix, &n| (mix ^ u64::from(n)).wrapping_mul(0x0100_0000_01b3))
}

#[test]
fn golden_bytes_mean_what_they_meant() {
    for set in InstructionSet::available() {
        let CompactMaterial { lattice, palette, gain, shape } = decode(stream(), set).unwrap();
        assert_eq!(lattice.theta_h, [0, 10, 41, 102, 108, 119, 137, 148, 157, 180]);
        assert_eq!(lattice.band, [0, 0, 0, 0, 1, 1, 1, 2, 2, 2]);
        assert_eq!(lattice.theta_d[1], [0, 85, 90, 100, 104, 180]);
        assert_eq!(lattice.phi_d[2], [0, 48, 79, 81, 92, 111, 140, 145, 160]);
        assert_eq!((palette.gains.len(), palette.gains[0], palette.gains[23]), (24, 15, 3946));
        assert_eq!((palette.shapes.len(), palette.shapes[0], palette.shapes[19]), (20, [-73, -17], [87, -20]));
        assert_eq!((gain.len(), mixed(&gain)), (295, GAIN));
        assert_eq!((shape.len(), mixed(&shape)), (295, SHAPE));
    }
}

/// Of the indices that the reader in plain Python finds.
const GAIN: u64 = 13_956_675_907_303_864_690;
const SHAPE: u64 = 3_077_851_287_756_070_471;

/// Whether a material gives the golden bytes.
fn gives_golden_bytes(material: &CompactMaterial) -> bool {
    InstructionSet::available().all(|set| encode(material, set).is_ok_and(|data| data == stream()))
}

#[test]
fn what_is_written_are_the_golden_bytes() {
    let mut material = read(stream()).unwrap();
    assert!(gives_golden_bytes(&material));
    let (head, indices) = measure(&material, InstructionSet::fastest()).unwrap();
    assert!((head + indices - 8.0 * stream().len() as f64).abs() < 32.0);
    material.gain[200] ^= 1;
    assert!(!gives_golden_bytes(&material));
}

/// Whether bytes are refused, or are the one stream of what they mean.
fn refused_or_the_only_stream(data: &[u8], read: impl Fn(&[u8]) -> Result<CompactMaterial, Error>) -> bool {
    read(data).is_err()
        || read(data).and_then(|found| encode(&found, InstructionSet::fastest())).is_ok_and(|d| d == data)
}

/// A reader that does not mind zeros at the end.
fn careless(data: &[u8]) -> Result<CompactMaterial, Error> {
    let end = data.iter().rposition(|&byte| byte != 0).map_or(0, |last| last + 1);
    read(&data[..end])
}

#[test]
fn every_length_and_every_changed_byte() {
    let data = stream();
    for length in 0..data.len() {
        assert!(refused_or_the_only_stream(&data[..length], read), "{length}");
    }
    for at in 0..data.len() {
        for change in [0x01, 0x41, 0x80, 0xff] {
            let mut changed = data.to_vec();
            changed[at] ^= change;
            assert!(refused_or_the_only_stream(&changed, read), "{at}");
        }
    }
    let longer = [data, b"\0"].concat();
    assert!(refused_or_the_only_stream(&longer, read));
    assert!(!refused_or_the_only_stream(&longer, careless));
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
        assert!(refused_or_the_only_stream(&data, read), "{data:?}");
    }
}
