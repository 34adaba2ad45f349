//! One of the kernels' works on a fixed input, to have its instructions counted: `benchmarks/instruction_counts.py` does.
//! The portable instruction set is used, since it is the same on all machines.

use std::hint::black_box;

use sommerl_codec::{CompactMaterial, InstructionSet, Layout, NodeLattice, Palette, decode, encode};
use sommerl_kernels::{Cubes, Epoch, Factors, Learner, NodeMaterial, NodeSteps, eval};

const SET: InstructionSet = InstructionSet::PORTABLE;

/// Numbers from 0 to 1 that look random.
fn numbers(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed;
    move || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// A material of 1,470 nodes, whose entries change slowly from one to the next.
fn material() -> CompactMaterial {
    let theta_h: Vec<u8> = (0..=20).map(|row| row * 9).collect();
    let lattice = NodeLattice {
        band: vec![0; theta_h.len()],
        theta_h,
        theta_d: vec![(0..=9).map(|step| step * 20).collect()],
        phi_d: vec![(0..=6).map(|step| step * 30).collect()],
        reciprocal: true,
        mirrored: true,
    };
    let palette = Palette {
        gains: (0..64).map(|gain| 20 * gain - 300).collect(),
        shapes: (0..32).map(|shape| [shape - 16, (7 * shape) % 11]).collect(),
    };
    let mut next = numbers(3);
    let gain = (0..lattice.nodes()).map(|node| (40 - node / 50 + (next() * 8.0) as usize) as u16).collect();
    let shape = (0..lattice.nodes()).map(|node| (node / 60 + (next() * 6.0) as usize) as u16).collect();
    CompactMaterial { lattice, palette, gain, shape }
}

fn directions(count: usize, seed: u64) -> Vec<[f64; 3]> {
    let mut next = numbers(seed);
    let mut one = || {
        let [x, y, z] = [next() - 0.5, next() - 0.5, next() * 0.5 + 0.01];
        let length = (x * x + y * y + z * z).sqrt();
        [x / length, y / length, z / length]
    };
    (0..count).map(|_| one()).collect()
}

fn train() {
    let mut next = numbers(1);
    let samples: Vec<[f32; 3]> = (0..20_000).map(|_| [0; 3].map(|_| next().powi(4) as f32)).collect();
    let mut learner = Learner::new(samples.clone(), (0..20_000).collect(), &samples[..128]);
    learner.set = SET;
    for alpha in [0.02, 0.012, 0.0072] {
        black_box(learner.present(0..20_000, &Epoch { alpha, falloff: &[1.0] }));
    }
}

fn lookup() {
    let CompactMaterial { lattice, palette, gain, shape } = material();
    let steps = NodeSteps::new(&lattice).expect("a lattice that can be looked up");
    let gains: Vec<f64> = palette.gains.iter().map(|&code| f64::from(code) / 128.0).collect();
    let shapes: Vec<[f64; 3]> = palette.shapes.iter().map(|s| [1.0, 1.0 + f64::from(s[0]) / 64.0, 1.0]).collect();
    let factors = Factors { gains: &gains, shapes: &shapes, gain: &gain, shape: &shape };
    let (wi, wo) = (directions(50_000, 5), directions(50_000, 6));
    let mut found = vec![[0.0; 3]; wi.len()];
    eval(&wi, &wo, &NodeMaterial::new(&steps, factors, Cubes::new(1.0, true, true), wi.len()), SET, 1, &mut found);
    black_box(found);
}

fn encoded() -> Vec<u8> {
    encode(&material(), SET).expect("a material that can be encoded")
}

fn decoded() {
    let layout = Layout::Second { reciprocal: true, mirrored: true };
    black_box(decode(&encoded(), layout, SET).expect("the stream of a material"));
}

fn main() {
    match std::env::args().nth(1).as_deref() {
        Some("train") => train(),
        Some("lookup") => lookup(),
        Some("encode") => drop(black_box(encoded())),
        Some("encode-decode") => decoded(),
        _ => panic!("expected train, lookup, encode or encode-decode"),
    }
}
