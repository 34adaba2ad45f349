//! Lookup of many pairs of directions: half/difference angles, cell, value. The same formulas, in the same order, as
//! `half_diff.py` and `lattice.py`; the arctangent is our own, so that it vectorises, and within 2 ulp of the library's.

use crate::simd::Path;

/// Pairs calculated together, stage by stage, in loops that vectorise.
const BATCH: usize = 64;
type Batch = [f64; BATCH];

/// The lattice, and how to look up in it.
#[derive(Clone, Copy)]
pub struct Lattice {
    pub bins: [usize; 3],
    pub reciprocal: bool,
    pub trilinear: bool,
}

/// What the cells hold: f_r itself, or the number of a LUT entry.
#[derive(Clone, Copy)]
pub enum Cells<'a> {
    Values(&'a [f64]),
    Index8(&'a [u8], &'a [f64]),
    Index16(&'a [u16], &'a [f64]),
}

impl Cells<'_> {
    pub fn len(&self) -> usize {
        match self {
            Cells::Values(values) => values.len() / 3,
            Cells::Index8(index, _) => index.len(),
            Cells::Index16(index, _) => index.len(),
        }
    }

    #[inline(always)]
    fn get(&self, cell: usize) -> [f64; 3] {
        let (table, at) = match self {
            Cells::Values(values) => (values, 3 * cell),
            Cells::Index8(index, lut) => (lut, 3 * index[cell] as usize),
            Cells::Index16(index, lut) => (lut, 3 * index[cell] as usize),
        };
        [table[at], table[at + 1], table[at + 2]]
    }
}

/// f_r of each pair (wi, wo) of directions, on several threads.
pub fn eval(
    wi: &[[f64; 3]],
    wo: &[[f64; 3]],
    lattice: Lattice,
    cells: Cells,
    path: Path,
    threads: usize,
) -> Vec<[f64; 3]> {
    let mut out = vec![[0.0; 3]; wi.len()];
    let share = wi.len().div_ceil(threads.max(1)).next_multiple_of(BATCH);
    std::thread::scope(|scope| {
        for ((wi, wo), out) in wi.chunks(share).zip(wo.chunks(share)).zip(out.chunks_mut(share)) {
            scope.spawn(move || eval_part(wi, wo, lattice, cells, path, out));
        }
    });
    out
}

fn eval_part(wi: &[[f64; 3]], wo: &[[f64; 3]], lattice: Lattice, cells: Cells, path: Path, out: &mut [[f64; 3]]) {
    for ((wi, wo), out) in wi.chunks(BATCH).zip(wo.chunks(BATCH)).zip(out.chunks_mut(BATCH)) {
        // SAFETY: a path is only ever one that this processor has.
        let position = unsafe {
            match path {
                Path::Portable => positions(wi, wo, lattice),
                #[cfg(target_arch = "x86_64")]
                Path::Avx2 => positions_avx2(wi, wo, lattice),
                #[cfg(target_arch = "x86_64")]
                Path::Avx512 => positions_avx512(wi, wo, lattice),
            }
        };
        for (i, value) in out.iter_mut().enumerate() {
            if wi[i][2] > 0.0 && wo[i][2] > 0.0 {
                let at = position.map(|axis| axis[i]);
                *value = if lattice.trilinear { trilinear(at, lattice, cells) } else { nearest(at, lattice, cells) };
            }
        }
    }
}

#[inline(always)]
fn nearest(at: [f64; 3], lattice: Lattice, cells: Cells) -> [f64; 3] {
    let [h, d, p] = std::array::from_fn(|axis| (at[axis] as usize).min(lattice.bins[axis] - 1));
    cells.get(p + lattice.bins[2] * (d + lattice.bins[1] * h))
}

/// As `Lattice.corners` and `Lattice.lookup`: θ_h and θ_d clamp, φ_d wraps; corners are added up in the same order.
#[inline(always)]
fn trilinear(at: [f64; 3], lattice: Lattice, cells: Cells) -> [f64; 3] {
    let [bins_h, bins_d, bins_p] = lattice.bins;
    let (h0, h1, a) = between(at[0], bins_h);
    let (d0, d1, b) = between(at[1], bins_d);
    let below = (at[2] - 0.5).floor();
    let c = (at[2] - 0.5) - below;
    let p0 = if below < 0.0 { bins_p - 1 } else { (below as usize).min(bins_p - 1) };
    let p1 = if p0 + 1 >= bins_p { 0 } else { p0 + 1 };
    let mut sum = [0.0; 3];
    for (h, u) in [(h0, 1.0 - a), (h1, a)] {
        for (d, v) in [(d0, 1.0 - b), (d1, b)] {
            for (p, w) in [(p0, 1.0 - c), (p1, c)] {
                let value = cells.get(p + bins_p * (d + bins_d * h));
                for j in 0..3 {
                    sum[j] += u * v * w * value[j];
                }
            }
        }
    }
    sum
}

#[inline(always)]
fn between(position: f64, bins: usize) -> (usize, usize, f64) {
    let x = (position - 0.5).max(0.0).min(bins as f64 - 1.0);
    let lower = x.floor().min((bins as f64 - 2.0).max(0.0));
    (lower as usize, lower as usize + (bins - 1).min(1), x - lower)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
unsafe fn positions_avx2(wi: &[[f64; 3]], wo: &[[f64; 3]], lattice: Lattice) -> [Batch; 3] {
    positions(wi, wo, lattice)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512dq,avx512vl")]
unsafe fn positions_avx512(wi: &[[f64; 3]], wo: &[[f64; 3]], lattice: Lattice) -> [Batch; 3] {
    positions(wi, wo, lattice)
}

/// Continuous bin numbers of a batch of pairs, as `half_diff` and `Lattice._position` give them.
#[inline(always)]
fn positions(wi: &[[f64; 3]], wo: &[[f64; 3]], lattice: Lattice) -> [Batch; 3] {
    let mut pairs = [[0.0; BATCH]; 6];
    for (i, (a, b)) in wi.iter().zip(wo).enumerate() {
        for j in 0..3 {
            pairs[j][i] = a[j];
            pairs[j + 3][i] = b[j];
        }
    }
    let half_pi = std::f64::consts::FRAC_PI_2;
    let [bins_h, bins_d, bins_p] = lattice.bins.map(|n| n as f64);
    let range = if lattice.reciprocal { std::f64::consts::PI } else { std::f64::consts::TAU };
    let mut out = [[0.0; BATCH]; 3];
    for i in 0..BATCH {
        let (sx, sy, sz) = (pairs[0][i] + pairs[3][i], pairs[1][i] + pairs[4][i], pairs[2][i] + pairs[5][i]);
        let (vx, vy, vz) = (pairs[0][i] - pairs[3][i], pairs[1][i] - pairs[4][i], pairs[2][i] - pairs[5][i]);
        let s = ((sx * sx + sy * sy) + sz * sz).sqrt();
        let v = ((vx * vx + vy * vy) + vz * vz).sqrt();
        let theta_h = atan2((sx * sx + sy * sy).sqrt(), sz);
        let theta_d = atan2(v, s);
        let x = 0.0 - vz * s;
        let y = (vy * sx - vx * sy) + 0.0;
        let other = (y < 0.0) | ((y == 0.0) & (x < 0.0));
        let (up, across) = if other { (-y, -x + 0.0) } else { (y, x + 0.0) };
        let folded = atan2(up, across);
        let phi_d = if lattice.reciprocal | !other { folded } else { folded + std::f64::consts::PI };
        out[0][i] = bins_h * (theta_h / half_pi).sqrt();
        out[1][i] = bins_d * (theta_d / half_pi);
        out[2][i] = bins_p * (phi_d / range);
    }
    out
}

/// The angle of (x, y) for y >= 0, in [0, π]; 0 for (0, 0). Rational approximation of Cephes (S. L. Moshier 1989), without
/// branches.
#[inline(always)]
fn atan2(y: f64, x: f64) -> f64 {
    use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};
    let (a, b) = (y, x.abs());
    let steep = a > b;
    let (small, large) = if steep { (b, a) } else { (a, b) };
    // t = small / large in [0, 1]; above 0.66, atan t = π/4 + atan((t - 1) / (t + 1)).
    let upper = small > 0.66 * large;
    let (top, bottom) = if upper { (small - large, small + large) } else { (small, large) };
    let t = top / if bottom == 0.0 { 1.0 } else { bottom };
    let z = t * t;
    let p = (((-8.750_608_600_031_904e-1 * z - 1.615_753_718_733_365e1) * z - 7.500_855_792_314_705e1) * z
        - 1.228_866_684_490_136_1e2)
        * z
        - 6.485_021_904_942_025e1;
    let q = ((((z + 2.485_846_490_142_306_2e1) * z + 1.650_270_098_316_988_6e2) * z + 4.328_810_604_912_902_6e2) * z
        + 4.853_903_996_359_137e2)
        * z
        + 1.945_506_571_482_614e2;
    let angle = t * (z * p / q) + t;
    let angle = if upper { (angle + 0.5 * 6.123_233_995_736_766e-17) + FRAC_PI_4 } else { angle };
    let angle = if steep { FRAC_PI_2 - angle } else { angle };
    if x < 0.0 { PI - angle } else { angle }
}
