//! Every instruction set gives the same bits as plain loops.

use crate::{InstructionSet, Line, Portable, Simd, for_each_instruction_set};

/// Numbers of all magnitudes and both signs, many of them equal.
fn lines() -> Vec<Line> {
    let special = [0.0, -0.0, 1.0, f32::INFINITY, f32::NEG_INFINITY, f32::MIN_POSITIVE, 1e-45, f32::MAX];
    (0..200_u32)
        .map(|n| {
            Line(std::array::from_fn(|i| {
                let hash = (16 * n + i as u32).wrapping_mul(0x9E37_79B9);
                if hash >> 28 < 8 { special[(hash >> 28) as usize] } else { (hash >> 8) as f32 / 65536.0 - 128.0 }
            }))
        })
        .collect()
}

/// All that the operations of an implementation give for two lines and a number, as bits.
///
/// # Safety
/// The processor has to have the instruction set.
#[inline(always)]
unsafe fn results<S: Simd>(x: &Line, y: &Line, number: f32) -> Vec<u32> {
    // SAFETY: the caller's.
    unsafe {
        let (a, b, c) = (S::load(x), S::load(y), S::splat(number));
        let lines = [
            S::add(a, b),
            S::sub(a, c),
            S::mul(a, b),
            S::min(a, b),
            S::max(b, c),
            S::select_lt(a, b, c, a),
            S::select_lt(c, b, a, b),
        ];
        let mut bits: Vec<u32> = lines.into_iter().flat_map(|line| S::store(line).0.map(f32::to_bits)).collect();
        bits.extend([S::le(a, b), S::le(c, b), S::smallest(a).to_bits(), S::smallest(c).to_bits()]);
        bits
    }
}

for_each_instruction_set! {
    fn results_on(x: &Line, y: &Line, number: f32) -> Vec<u32> {
        // SAFETY: the function is compiled for the instruction set of `Lanes`.
        unsafe { results::<Lanes>(x, y, number) }
    }
}

/// Whether an instruction set gives the bits of plain loops, where `other` is the second line for these.
fn same_bits(set: InstructionSet, other: impl Fn(&Line) -> Line) -> bool {
    let lines = lines();
    lines.windows(2).all(|pair| {
        let number = pair[0].0[5];
        // SAFETY: plain loops need nothing.
        let expected = unsafe { results::<Portable>(&pair[0], &other(&pair[1]), number) };
        same(&results_on(set, &pair[0], &pair[1], number), &expected)
    })
}

/// The same bits; but any NaN for a NaN, whose bits IEEE 754 leaves open, and any zero for a zero, as the smaller of two.
fn same(found: &[u32], expected: &[u32]) -> bool {
    found.iter().zip(expected).all(|(&a, &b)| {
        let (x, y) = (f32::from_bits(a), f32::from_bits(b));
        a == b || (x.is_nan() && y.is_nan()) || (x == 0.0 && y == 0.0)
    })
}

#[test]
fn all_instruction_sets_agree() {
    for set in InstructionSet::available() {
        assert!(same_bits(set, |line| *line), "{}", set.name());
        assert!(!same_bits(set, |line| Line(line.0.map(|x| x + 1.0))), "{}", set.name());
    }
}

#[test]
fn instruction_sets_have_names_of_their_own() {
    let names: Vec<_> = InstructionSet::available().map(InstructionSet::name).collect();
    assert_eq!(names[0], "portable");
    assert_eq!(names.last(), Some(&InstructionSet::fastest().name()));
    assert!(names.iter().enumerate().all(|(i, name)| !names[..i].contains(name)));
}
