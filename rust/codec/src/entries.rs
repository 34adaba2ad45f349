//! How likely each gain, or each shape, is: weights that fall with the distance from the predicted place.

use std::ops::Range;

use crate::range_coder::Weights;

/// The two kernels. An entry at distance x, in units of the expected error, has the height 1 / (1 + x² NARROW)² or
/// 1 / (1 + x² WIDE)².
const NARROW: f64 = 2.25;
const WIDE: f64 = 0.25;
/// What the kernels give to all entries together. Each entry has 1 besides.
const WHOLE: f64 = 65536.0;
/// A sum is calculated as that many sums, each of every fourth number, which one vector holds.
const LANES: usize = 4;
/// Entries whose first coordinate is farther away than that, in expected errors, have the weight 1. The distance is rounded
/// outwards to whole steps, of which there are `STEPS_TO_1` to 1 and `FARTHEST_STEP` to either side of 0.
const REACH: f64 = 16.0;
const STEPS_TO_1: f64 = 64.0;
const FARTHEST_STEP: f64 = 2048.0;

/// For both coordinates: what is predicted, and 1 / the expected error.
pub type Expected = [(f64, f64); 2];

/// The gains, or the shapes: where they are, and how often each one has come so far.
pub struct Entries {
    /// Both coordinates of each entry. The first does not decrease.
    pub places: [Vec<f64>; 2],
    /// For each step of the first coordinate, how many entries lie before it.
    before: Vec<u16>,
    /// 1 + how often each entry has come, and the square roots, which kernels are multiplied with.
    counts: Vec<f64>,
    roots: Vec<f64>,
    /// The share of the narrow kernel.
    narrow: f64,
    /// What the two kernels are multiplied with, so that over all entries both together add up to 1.
    factors: [f64; 2],
    /// What `weigh` found, and where those are that are not 1.
    weights: Vec<u32>,
    reach: Range<usize>,
    /// The number of entries within `REACH`, added up over all calls of `weigh`.
    pub reached: usize,
    /// Memory for the heights of the two kernels.
    heights: [Vec<f64>; 2],
}

impl Entries {
    pub fn new(places: [Vec<f64>; 2]) -> Self {
        let n = places[0].len();
        let mut before = vec![0; step(f64::INFINITY) + 2];
        for &place in &places[0] {
            before[step(place) + 1] += 1;
        }
        for i in 1..before.len() {
            before[i] += before[i - 1];
        }
        Entries {
            places,
            before,
            counts: vec![1.0; n],
            roots: vec![1.0; n],
            narrow: 0.5,
            factors: [1.0; 2],
            weights: vec![1; n],
            reach: 0..0,
            reached: 0,
            heights: [vec![0.0; n], vec![0.0; n]],
        }
    }

    /// The weights of all entries.
    #[inline(always)]
    pub fn weigh(&mut self, expected: &Expected) -> Weights<'_> {
        let [(p0, s0), (p1, s1)] = *expected;
        let reach = REACH / s0;
        let range = self.before[step(p0 - reach)].into()..self.before[step(p0 + reach) + 1].into();
        let [first, second] = self.places.each_ref().map(|places| &places[range.clone()]);
        let roots = &self.roots[range.clone()];
        self.reached += roots.len();
        let [narrow, wide] = self.heights.each_mut().map(|heights| &mut heights[..roots.len()]);
        let (first, second) = (&first[..roots.len()], &second[..roots.len()]);
        for i in 0..roots.len() {
            (narrow[i], wide[i]) = kernels(roots[i], (first[i] - p0) * s0, (second[i] - p1) * s1);
        }
        self.factors = [self.narrow / sum(narrow), (1.0 - self.narrow) / sum(wide)];
        let [to_narrow, to_wide] = self.factors.map(|factor| factor * WHOLE);
        self.weights[std::mem::replace(&mut self.reach, range.clone())].fill(1);
        let weights = &mut self.weights[range];
        let mut above_1 = 0;
        for i in 0..roots.len() {
            let more = (narrow[i] * to_narrow + wide[i] * to_wide) as u32;
            weights[i] = 1 + more;
            above_1 += more;
        }
        Weights { each: &self.weights, total: self.weights.len() as u32 + above_1 }
    }

    /// Adapts to the entry that came. expected: as for the last call of `weigh`.
    #[inline(always)]
    pub fn learn(&mut self, entry: usize, expected: &Expected) {
        let x = (self.places[0][entry] - expected[0].0) * expected[0].1;
        let y = (self.places[1][entry] - expected[1].0) * expected[1].1;
        let (narrow, wide) = kernels(self.roots[entry], x, y);
        let (narrow, wide) = (narrow * self.factors[0], wide * self.factors[1]);
        self.narrow = 0.96 * (narrow / (narrow + wide)) + 0.02;
        self.counts[entry] += 1.0;
        self.roots[entry] = self.counts[entry].sqrt();
    }
}

/// The number of the step that a first coordinate lies in.
#[inline(always)]
fn step(place: f64) -> usize {
    (place * STEPS_TO_1 + FARTHEST_STEP).clamp(0.0, 2.0 * FARTHEST_STEP) as usize
}

/// The heights of the narrow and of the wide kernel at a distance, times the root.
#[inline(always)]
fn kernels(root: f64, x: f64, y: f64) -> (f64, f64) {
    let (x, y) = (x * x, y * y);
    let a = (1.0 + x * NARROW) * (1.0 + y * NARROW);
    let b = (1.0 + x * WIDE) * (1.0 + y * WIDE);
    let (a, b) = (a * a, b * b);
    let both = root / (a * b);
    (both * b, both * a)
}

/// The sum, in the order that docs/format.md calls `sum4`.
#[inline(always)]
fn sum(values: &[f64]) -> f64 {
    let mut lanes = [0.0; LANES];
    let whole = values.chunks_exact(LANES);
    let rest = whole.remainder();
    for part in whole {
        for lane in 0..LANES {
            lanes[lane] += part[lane];
        }
    }
    for (lane, value) in lanes.iter_mut().zip(rest) {
        *lane += value;
    }
    (lanes[0] + lanes[1]) + (lanes[2] + lanes[3]) + 1e-300
}
