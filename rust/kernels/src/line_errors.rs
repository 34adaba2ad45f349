//! How much is lost where a material is interpolated linearly between two places of an axis, for every two places: what the choice
//! of nodes is made from.

use sommerl_simd::{InstructionSet, for_each_instruction_set};

use crate::threads::share_out;

/// Lines that are calculated together. Sums are taken over each such block, and then over the blocks, in order.
const BLOCK: usize = 64;
type Lines = [f64; BLOCK];
/// Numbers that are added up one by one, and not in one chain, so that they are added as vectors.
const LANES: usize = 8;

/// Sums over the places before one, for each line: of w xᵐ (m = 0, 1, 2), of w y and w x y for each channel, and of w |y|².
#[derive(Clone)]
struct Sums {
    w: [Lines; 3],
    y: [[Lines; 3]; 2],
    squares: Lines,
}

/// A place on each line: its three values.
type Values = [Lines; 3];

/// The weighted squared error at all places between i and j if a line through the values at i and j stands for them, summed over
/// lines: row i of the matrix holds it for every j > i, and infinity elsewhere.
///
/// y: the values on `places` times `lines`, line after line for each place. weight: likewise. Panics if sizes do not fit.
pub fn line_errors(places: usize, y: &[[f64; 3]], weight: &[f64], set: InstructionSet, threads: usize) -> Vec<f64> {
    assert!(places > 0 && y.len() == weight.len() && y.len().is_multiple_of(places));
    let lines = y.len() / places;
    let mut parts: Vec<Vec<f64>> = vec![Vec::new(); lines.div_ceil(BLOCK)];
    share_out(parts.iter_mut().enumerate(), threads, |(block, part)| {
        let first = block * BLOCK;
        let (sums, values) = prepared(places, first, lines, y, weight);
        *part = vec![0.0; places * places];
        block_errors(set, &sums, &values, part);
    });
    let mut errors = vec![f64::INFINITY; places * places];
    for i in 0..places {
        for j in i + 1..places {
            errors[i * places + j] = parts.iter().map(|part| part[i * places + j]).sum();
        }
    }
    errors
}

/// The sums before each place and after the last, and the values, of the lines from `first` on; lines that are not there are 0.
fn prepared(places: usize, first: usize, lines: usize, y: &[[f64; 3]], weight: &[f64]) -> (Vec<Sums>, Vec<Values>) {
    let none = [0.0; BLOCK];
    let mut sums = vec![Sums { w: [none; 3], y: [[none; 3]; 2], squares: none }];
    let mut values = Vec::with_capacity(places);
    for k in 0..places {
        let (mut next, mut here, x) = (sums[k].clone(), [none; 3], k as f64);
        for l in 0..BLOCK.min(lines - first) {
            let (w, v) = (weight[k * lines + first + l], y[k * lines + first + l]);
            for (m, power) in [1.0, x, x * x].into_iter().enumerate() {
                next.w[m][l] += w * power;
            }
            for c in 0..3 {
                here[c][l] = v[c];
                next.y[0][c][l] += w * v[c];
                next.y[1][c][l] += w * x * v[c];
            }
            next.squares[l] += w * (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
        }
        sums.push(next);
        values.push(here);
    }
    (sums, values)
}

for_each_instruction_set! {
    fn block_errors(sums: &[Sums], values: &[Values], errors: &mut [f64]) {
        let places = values.len();
        for i in 0..places {
            for j in i + 1..places {
                errors[i * places + j] = between(i, j, &sums[i + 1], &sums[j], &values[i], &values[j]);
            }
        }
    }
}

/// The error between the places i and j. after: the sums before i + 1; before: those before j.
#[inline(always)]
fn between(i: usize, j: usize, after: &Sums, before: &Sums, a: &Values, b: &Values) -> f64 {
    let (i, per_length) = (i as f64, 1.0 / (j - i) as f64);
    let mut total = [0.0; LANES];
    for start in (0..BLOCK).step_by(LANES) {
        let lane = |line: &Lines| -> [f64; LANES] { std::array::from_fn(|k| line[start + k]) };
        let moment = |m: usize| {
            let (x, y) = (lane(&before.w[m]), lane(&after.w[m]));
            each(|k| x[k] - y[k])
        };
        let (w0, x1, x2) = (moment(0), moment(1), moment(2));
        // Moments of t, which is 0 at i and 1 at j.
        let w1 = each(|k| (x1[k] - i * w0[k]) * per_length);
        let w2 = each(|k| (x2[k] - 2.0 * i * x1[k] + i * i * w0[k]) * (per_length * per_length));
        let [mut dots, mut aa, mut bb, mut ab] = [[0.0; LANES]; 4];
        for c in 0..3 {
            let sum = |m: usize| {
                let (x, y) = (lane(&before.y[m][c]), lane(&after.y[m][c]));
                each(|k| x[k] - y[k])
            };
            let (s0, x1, a, b) = (sum(0), sum(1), lane(&a[c]), lane(&b[c]));
            let s1 = each(|k| (x1[k] - i * s0[k]) * per_length);
            dots = each(|k| dots[k] + ((s0[k] - s1[k]) * a[k] + s1[k] * b[k]));
            aa = each(|k| aa[k] + a[k] * a[k]);
            bb = each(|k| bb[k] + b[k] * b[k]);
            ab = each(|k| ab[k] + a[k] * b[k]);
        }
        let (all, none) = (lane(&before.squares), lane(&after.squares));
        let error = each(|k| {
            let squares = (w0[k] - 2.0 * w1[k] + w2[k]) * aa[k] + w2[k] * bb[k] + 2.0 * (w1[k] - w2[k]) * ab[k];
            (all[k] - none[k]) - 2.0 * dots[k] + squares
        });
        total = each(|k| total[k] + if error[k] > 0.0 { error[k] } else { 0.0 });
    }
    total.iter().sum()
}

/// A number for each lane.
#[inline(always)]
fn each(f: impl Fn(usize) -> f64) -> [f64; LANES] {
    std::array::from_fn(f)
}
