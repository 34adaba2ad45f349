//! What Rust's own tools can watch: overflows, and that instruction sets, ways of searching and numbers of threads change no bit.
//! That the results are right is for the package's tests, which compare with NumPy. Each check is also run on something that it
//! has to refuse.

use sommerl_codec::NodeLattice;
use sommerl_simd::InstructionSet;

use crate::threads::share_out;
use crate::{
    CellLattice, CellMaterial, Cells, Cubes, Epoch, Factors, Learner, Material, NodeMaterial, NodeSteps, Quantiser,
    Rule, Search, eval,
};

/// Numbers from 0 to 1 that look random.
fn numbers(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed;
    move || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    }
}

fn triples(count: usize, seed: u64) -> Vec<[f32; 3]> {
    let mut next = numbers(seed);
    // Few values each, so that many triples are equal or equally near.
    (0..count).map(|_| [0; 3].map(|_| (next() * 12.0).floor() as f32 / 12.0)).collect()
}

fn directions(count: usize, seed: u64) -> Vec<[f64; 3]> {
    let mut next = numbers(seed);
    let mut found: Vec<[f64; 3]> = (0..count)
        .map(|_| {
            let [x, y, z] = [next() - 0.5, next() - 0.5, next() - 0.05];
            let length = (x * x + y * y + z * z).sqrt();
            [x / length, y / length, z / length]
        })
        .collect();
    let odd = [[0.0, 0.0, 1.0], [0.0; 3], [f64::NAN; 3], [0.0, f64::INFINITY, 1.0], [1e300; 3], [1e-300; 3]];
    found[..odd.len()].copy_from_slice(&odd);
    found
}

/// Weights, stored cells and error after some epochs.
fn trained(set: InstructionSet, search: Search, reach: usize) -> (Vec<[u32; 3]>, Vec<[u32; 3]>, Vec<u64>) {
    let samples = triples(3000, 1);
    let mut learner = Learner::new(samples.clone(), (0..3000).collect(), &samples[..37]);
    (learner.set, learner.search, learner.columns, learner.rule) = (set, search, 7, Rule::Paper);
    let falloff: Vec<f32> = (0..=reach).map(|distance| 0.5_f32.powi(distance as i32)).collect();
    let errors = [0.1, 0.03].map(|alpha| learner.present(0..3000, &Epoch { alpha, falloff: &falloff }).to_bits());
    let weights = learner.weights().into_iter().map(|weight| weight.map(f32::to_bits)).collect();
    (weights, learner.stored_cells(), errors.to_vec())
}

#[test]
fn training_depends_on_neither_instruction_set_nor_search() {
    for reach in [0, 2] {
        let expected = trained(InstructionSet::PORTABLE, Search::Scalar, reach);
        for set in InstructionSet::available() {
            for search in [Search::Boxes, Search::All, Search::Scalar] {
                assert!(trained(set, search, reach) == expected, "{}", set.name());
            }
        }
        assert!(trained(InstructionSet::PORTABLE, Search::Scalar, 1 + reach) != expected);
    }
}

/// Whether the entries found are the lowest of the nearest.
fn nearest(lut: &[[f32; 3]], triples: &[[f32; 3]], found: &[u32]) -> bool {
    let distance = |x: &[f32; 3], c: &[f32; 3]| {
        let [r, g, b] = [0, 1, 2].map(|j| x[j] - c[j]);
        (r * r + g * g) + b * b
    };
    triples.iter().zip(found).all(|(x, &found)| {
        let best = distance(x, &lut[found as usize]);
        let earlier = lut[..found as usize].iter().all(|entry| distance(x, entry) > best);
        earlier && lut.iter().all(|entry| distance(x, entry) >= best)
    })
}

#[test]
fn a_quantiser_finds_the_lowest_of_the_nearest() {
    for entries in [1, 15, 16, 17, 300] {
        let (lut, samples) = (triples(entries, 2), triples(1000, 3));
        let mut found = vec![0; 1000];
        for set in InstructionSet::available() {
            for (in_boxes, threads) in [(true, 1), (true, 3), (false, 1), (false, 3)] {
                found.fill(u32::MAX);
                Quantiser::new(&lut, in_boxes, set, threads).query(&samples, &mut found);
                assert!(nearest(&lut, &samples, &found), "{entries} {}", set.name());
            }
        }
        if entries > 1 {
            found[500] = (found[500] + 1) % entries as u32;
            assert!(!nearest(&lut, &samples, &found));
        }
    }
}

fn looked_up(material: &impl Material, set: InstructionSet, threads: usize) -> Vec<[u64; 3]> {
    let (wi, wo) = (directions(1000, 4), directions(1000, 5));
    let mut out = vec![[f64::NAN; 3]; 1000];
    eval(&wi, &wo, material, set, threads, &mut out);
    // All NaNs are alike.
    out.into_iter().map(|f_r| f_r.map(|x| if x.is_nan() { u64::MAX } else { x.to_bits() })).collect()
}

/// Whether all instruction sets and numbers of threads give the same, and 0, NaN and other numbers occur in it.
fn same_everywhere(material: &impl Material, expected: &[[u64; 3]]) -> bool {
    let numbers = expected.as_flattened();
    let kinds =
        [0, u64::MAX].iter().all(|kind| numbers.contains(kind)) && numbers.iter().any(|&x| x.wrapping_add(1) > 1);
    kinds && InstructionSet::available().all(|set| [1, 3].iter().all(|&n| looked_up(material, set, n) == expected))
}

/// Whether pairs above the horizon give the same one by one.
fn one_by_one_too(eval: impl Fn([f64; 3], [f64; 3]) -> [f64; 3], expected: &[[u64; 3]]) -> bool {
    let pairs = directions(1000, 4).into_iter().zip(directions(1000, 5));
    let above =
        |(wi, wo): &([f64; 3], [f64; 3])| wi.iter().chain(wo).all(|x| x.is_finite()) && wi[2] > 0.0 && wo[2] > 0.0;
    let mut asked = pairs.zip(expected).filter(|(pair, _)| above(pair));
    asked.all(|((wi, wo), f_r)| eval(wi, wo).map(f64::to_bits) == *f_r)
}

#[test]
fn lookup_in_cells() {
    let mut next = numbers(6);
    let (values, lut): (Vec<f64>, Vec<f64>) =
        ((0..3 * 240).map(|_| next()).collect(), (0..30).map(|_| next()).collect());
    let index: Vec<u8> = (0..240).map(|_| (next() * 10.0) as u8).collect();
    let wide: Vec<u16> = index.iter().map(|&entry| entry.into()).collect();
    for reciprocal in [false, true] {
        for trilinear in [false, true] {
            let lattice = CellLattice { bins: [4, 5, 12], reciprocal, trilinear };
            let held = [Cells::Values(&values), Cells::Index8(&index, &lut), Cells::Index16(&wide, &lut)];
            let [direct, narrow, wide] = held.map(|cells| CellMaterial { lattice, cells });
            let found = [&direct, &narrow].map(|material| looked_up(material, InstructionSet::PORTABLE, 1));
            assert!(same_everywhere(&direct, &found[0]));
            assert!(same_everywhere(&narrow, &found[1]));
            assert!(same_everywhere(&wide, &found[1]));
            assert!(!same_everywhere(&direct, &found[1]));
            for (material, found) in [&direct, &narrow, &wide].into_iter().zip([&found[0], &found[1], &found[1]]) {
                assert!(one_by_one_too(|wi, wo| material.eval(wi, wo), found));
            }
            assert!(!one_by_one_too(|wi, wo| direct.eval(wi, wo), &found[1]));
        }
    }
}

#[test]
fn lookup_in_cells_reads_nothing_outside() {
    let (index, lut) = (vec![u16::MAX; 240], vec![1.0; 30]);
    let lattice = CellLattice { bins: [4, 5, 12], reciprocal: true, trilinear: true };
    let material = CellMaterial { lattice, cells: Cells::Index16(&index, &lut) };
    let found = looked_up(&material, InstructionSet::fastest(), 1);
    assert!(found.as_flattened().iter().all(|&bits| bits == 0 || bits == u64::MAX));
}

#[test]
fn lookup_on_nodes() {
    for reciprocal in [false, true] {
        for signed in [false, true] {
            looks_up_on_nodes(vec![0, 50, 90, 140], reciprocal, false, signed);
            looks_up_on_nodes(vec![0, 50, 90, 180], reciprocal, true, signed);
        }
    }
}

/// phi_d: of one of two bands.
fn looks_up_on_nodes(phi_d: Vec<u8>, reciprocal: bool, mirrored: bool, signed: bool) {
    let lattice = NodeLattice {
        theta_h: vec![0, 3, 40, 90, 180],
        band: vec![1, 0, 0, 1, 1],
        theta_d: vec![vec![0, 60, 180], vec![0, 180]],
        phi_d: vec![phi_d, vec![0]],
        reciprocal,
        mirrored,
    };
    let steps = NodeSteps::new(&lattice).unwrap();
    assert_eq!(steps.nodes(), 2 + 12 + 12 + 2 + 2);
    let mut next = numbers(7);
    let gains: Vec<f64> = (0..9).map(|_| next() - 0.4).collect();
    let shapes: Vec<[f64; 3]> = (0..8).map(|_| [0; 3].map(|_| next() - 0.1)).collect();
    let (gain, shape): (Vec<u16>, Vec<u16>) = (0..30).map(|_| ((next() * 9.0) as u16, (next() * 8.0) as u16)).unzip();
    let factors = Factors { gains: &gains, shapes: &shapes, gain: &gain, shape: &shape };
    assert!(factors.fit(30) && !factors.fit(29));
    let made = |factors, pairs| NodeMaterial::new(&steps, factors, Cubes::new(0.3, signed, false), pairs);
    let expected = looked_up(&made(factors, 1000), InstructionSet::PORTABLE, 1);
    let below = |bits: &u64| f64::from_bits(*bits) < 0.0;
    assert_eq!(expected.as_flattened().iter().any(below), signed);
    let one_by_one = |scale| {
        let cubes = Cubes::new(scale, signed, false);
        one_by_one_too(|wi, wo| steps.eval(wi, wo, cubes, |node| factors.value(node)), &expected)
    };
    assert!(one_by_one(0.3) && !one_by_one(0.4));
    for pairs in [0, 1000] {
        assert!(same_everywhere(&made(factors, pairs), &expected));
        let outside = Factors { gain: &gain[..9], shapes: &shapes[..3], ..factors };
        assert!(!same_everywhere(&made(outside, pairs), &expected));
    }
    assert!(NodeSteps::new(&NodeLattice { mirrored: !mirrored, ..lattice.clone() }).is_none());
    assert!(NodeSteps::new(&NodeLattice { band: vec![0; 4], ..lattice }).is_none());
}

#[test]
fn a_task_that_panics_stops_no_other() {
    let done = std::sync::atomic::AtomicUsize::new(0);
    let work = |task: usize| {
        assert!(task != 3, "the task that panics");
        done.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
    };
    let result = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| share_out(0..20, 4, work)));
    assert!(result.is_err());
    assert_eq!(done.into_inner(), 19);
}
