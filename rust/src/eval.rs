//! Lookup of many pairs of directions: half/difference angles, cell, value. The same formulas, in the same order, as
//! `half_diff.py` and `lattice.py`; the arctangent is our own, so that it vectorises, and within 2 ulp of the library's.

use crate::simd::Path;
use crate::threads::share_out;

/// Pairs calculated together, stage by stage, in loops that vectorise.
pub const BATCH: usize = 64;
type Batch = [f64; BATCH];
/// Numbers of a batch that one stage leaves to the next.
pub type Room = [Batch; 4];

/// What pairs of directions are evaluated for.
pub trait Material: Sync {
    /// Writes f_r of up to BATCH pairs, `Pairs::told` where they say it all. Every element is written. To be inlined always: it
    /// is compiled once for each instruction set.
    fn batch(&self, pairs: &Pairs, room: &mut Room, out: &mut [[f64; 3]]);
}

/// Cells on a lattice.
pub struct OnLattice<'a> {
    pub lattice: Lattice,
    pub cells: Cells<'a>,
}

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

    /// Whether the values are triples.
    pub fn whole(&self) -> bool {
        let (Cells::Values(values) | Cells::Index8(_, values) | Cells::Index16(_, values)) = self;
        values.len().is_multiple_of(3)
    }
}

/// Writes f_r of each pair (wi, wo) of directions to `out`, on several threads; zeros where one is below the horizon, NaN where
/// a component is no finite number. Every element is written: `out` may be fresh memory.
pub fn eval(
    wi: &[[f64; 3]],
    wo: &[[f64; 3]],
    material: &impl Material,
    path: Path,
    threads: usize,
    out: &mut [[f64; 3]],
) {
    let share = wi.len().div_ceil(threads.max(1)).next_multiple_of(BATCH).max(BATCH);
    if wi.len() <= share {
        return eval_part(wi, wo, material, path, out); // a thread takes longer to start than a few pairs
    }
    let parts = wi.chunks(share).zip(wo.chunks(share)).zip(out.chunks_mut(share));
    share_out(parts, threads, |((wi, wo), out)| eval_part(wi, wo, material, path, out));
}

fn eval_part(wi: &[[f64; 3]], wo: &[[f64; 3]], material: &impl Material, path: Path, out: &mut [[f64; 3]]) {
    // SAFETY: a path is only ever one that this processor has.
    unsafe {
        match path {
            Path::Portable => batches(wi, wo, material, out),
            #[cfg(target_arch = "x86_64")]
            Path::Avx2 => batches_avx2(wi, wo, material, out),
            #[cfg(target_arch = "x86_64")]
            Path::Avx512 => batches_avx512(wi, wo, material, out),
        }
    }
}

#[inline(always)]
fn batches(wi: &[[f64; 3]], wo: &[[f64; 3]], material: &impl Material, out: &mut [[f64; 3]]) {
    let mut pairs = Pairs([[0.0; BATCH]; 7]);
    let mut room = [[0.0; BATCH]; 4];
    for ((wi, wo), out) in wi.chunks(BATCH).zip(wo.chunks(BATCH)).zip(out.chunks_mut(BATCH)) {
        pairs.set(wi, wo);
        material.batch(&pairs, &mut room, out);
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
unsafe fn batches_avx2(wi: &[[f64; 3]], wo: &[[f64; 3]], material: &impl Material, out: &mut [[f64; 3]]) {
    batches(wi, wo, material, out)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512dq,avx512vl")]
unsafe fn batches_avx512(wi: &[[f64; 3]], wo: &[[f64; 3]], material: &impl Material, out: &mut [[f64; 3]]) {
    batches(wi, wo, material, out)
}

/// The components of a batch of pairs, those of one kind one after the other; and what is known of each: see `told`. After the
/// last pair of all there may be others.
pub struct Pairs([Batch; 7]);

impl Pairs {
    #[inline(always)]
    fn set(&mut self, wi: &[[f64; 3]], wo: &[[f64; 3]]) {
        for (i, (a, b)) in wi.iter().zip(wo).enumerate() {
            for j in 0..3 {
                self.0[j][i] = a[j];
                self.0[j + 3][i] = b[j];
            }
        }
        let [x, y, z, u, v, w, told] = &mut self.0;
        for i in 0..BATCH {
            // 0, or NaN
            let all = (x[i] * 0.0 + y[i] * 0.0 + z[i] * 0.0) + (u[i] * 0.0 + v[i] * 0.0 + w[i] * 0.0);
            told[i] = all + f64::from(u8::from((z[i] > 0.0) & (w[i] > 0.0)));
        }
    }

    /// What is known of a pair without looking at the material: 0 unless both directions are above the horizon; and NaN if any
    /// component is no finite number. None if it is up to the material.
    #[inline(always)]
    pub fn told(&self, i: usize) -> Option<f64> {
        let told = self.0[6][i];
        (told != 1.0).then_some(told)
    }

    /// cos θ_i and cos θ_o of a pair.
    #[inline(always)]
    pub fn cosines(&self, i: usize) -> [f64; 2] {
        [self.0[2][i], self.0[5][i]]
    }

    /// θ_h, θ_d and φ_d of a pair, as `half_diff` gives them.
    #[inline(always)]
    pub fn half_diff(&self, i: usize, reciprocal: bool) -> [f64; 3] {
        let pairs = &self.0;
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
        let phi_d = if reciprocal | !other { folded } else { folded + std::f64::consts::PI };
        [theta_h, theta_d, phi_d]
    }
}

impl Material for OnLattice<'_> {
    #[inline(always)]
    fn batch(&self, pairs: &Pairs, room: &mut Room, out: &mut [[f64; 3]]) {
        positions(pairs, self.lattice, room);
        match self.cells {
            Cells::Values(values) => {
                if !self.lattice.trilinear {
                    room[0].iter().for_each(|&cell| prefetch(values, 3 * (cell as u32 as usize)));
                }
                fill(pairs, self.lattice, room, out, |cell| triple(values, cell));
            }
            Cells::Index8(index, lut) => fill(pairs, self.lattice, room, out, |cell| triple(lut, index[cell] as usize)),
            Cells::Index16(index, lut) => {
                fill(pairs, self.lattice, room, out, |cell| triple(lut, index[cell] as usize))
            }
        }
    }
}

/// Asks for a line of memory before it is read: a table is larger than the caches, and its cells are read in no order.
#[inline(always)]
fn prefetch(table: &[f64], at: usize) {
    #[cfg(target_arch = "x86_64")]
    // SAFETY: prefetching is allowed for any address.
    unsafe {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        _mm_prefetch::<_MM_HINT_T0>(table.as_ptr().wrapping_add(at).cast());
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = (table, at);
}

/// NaN where there is no such entry.
#[inline(always)]
fn triple(table: &[f64], entry: usize) -> [f64; 3] {
    match table.get(3 * entry..3 * entry + 3) {
        Some(&[r, g, b]) => [r, g, b],
        _ => [f64::NAN; 3],
    }
}

#[inline(always)]
fn fill(pairs: &Pairs, lattice: Lattice, at: &Room, out: &mut [[f64; 3]], get: impl Fn(usize) -> [f64; 3]) {
    for (i, value) in out.iter_mut().enumerate().take(BATCH) {
        let found = if lattice.trilinear {
            trilinear([at[0][i], at[1][i], at[2][i]], lattice.bins, &get)
        } else {
            get(at[0][i] as u32 as usize)
        };
        *value = pairs.told(i).map_or(found, |told| [told; 3]);
    }
}

/// As `Lattice.corners` and `Lattice.lookup`: θ_h and θ_d clamp, φ_d wraps; corners are added up in the same order.
#[inline(always)]
fn trilinear(at: [f64; 3], [bins_h, bins_d, bins_p]: [usize; 3], get: impl Fn(usize) -> [f64; 3]) -> [f64; 3] {
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
                let value = get(p + bins_p * (d + bins_d * h));
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

/// Continuous bin numbers of a batch of pairs, as `half_diff` and `Lattice._position` give them; for the nearest cell, its
/// number in the place of the first.
#[inline(always)]
fn positions(pairs: &Pairs, lattice: Lattice, at: &mut Room) {
    if lattice.trilinear {
        positions_for::<true>(pairs, lattice, at)
    } else {
        positions_for::<false>(pairs, lattice, at)
    }
}

#[inline(always)]
fn positions_for<const TRILINEAR: bool>(pairs: &Pairs, lattice: Lattice, at: &mut Room) {
    let half_pi = std::f64::consts::FRAC_PI_2;
    let [bins_h, bins_d, bins_p] = lattice.bins.map(|n| n as f64);
    let range = if lattice.reciprocal { std::f64::consts::PI } else { std::f64::consts::TAU };
    for i in 0..BATCH {
        let [theta_h, theta_d, phi_d] = pairs.half_diff(i, lattice.reciprocal);
        let u = bins_h * (theta_h * (1.0 / half_pi)).sqrt();
        let (v, w) = (theta_d * (bins_d / half_pi), phi_d * (bins_p / range));
        let w = if w > 0.0 { w } else { 0.0 }; // where lengths overflow, it is no number
        let bin = |position: f64, bins: f64| position.min(bins - 1.0).floor();
        let cell = bin(w, bins_p) + bins_p * (bin(v, bins_d) + bins_d * bin(u, bins_h));
        let numbers = if TRILINEAR { &[u, v, w][..] } else { &[cell] };
        for (at, &number) in at.iter_mut().zip(numbers) {
            at[i] = number;
        }
    }
}

/// The angle of (x, y) for y >= 0, in [0, π]; 0 for (0, 0). Within 2 ulp. The reduction to |t| < 7/16 and the polynomial are those
/// of fdlibm (Sun Microsystems 1993); here without branches and with one division, so that it vectorises.
#[inline(always)]
fn atan2(y: f64, x: f64) -> f64 {
    use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};
    const ATAN_HALF: f64 = 4.636_476_090_008_061e-1;
    let a = x.abs();
    let steep = y > a;
    let (small, large) = if steep { (a, y) } else { (y, a) };
    // atan t = atan ½ + atan((2 t - 1) / (2 + t)) = π/4 + atan((t - 1) / (t + 1))
    let (middle, upper) = (small > 0.4375 * large, small > 0.6875 * large);
    let top = if middle { 2.0 * small - large } else { small };
    let bottom = if middle { 2.0 * large + small } else { large };
    let top = if upper { small - large } else { top };
    let bottom = if upper { small + large } else { bottom };
    let base = if middle { ATAN_HALF } else { 0.0 };
    let rest = if middle { 2.269_877_745_296_168_7e-17 } else { 0.0 };
    let base = if upper { FRAC_PI_4 } else { base };
    let rest = if upper { 3.061_616_997_868_383e-17 } else { rest };
    let t = top / if bottom == 0.0 { 1.0 } else { bottom };
    let (z, w) = (t * t, (t * t) * (t * t));
    let odd = 3.333_333_333_333_293e-1
        + w * (1.428_571_427_250_346_6e-1
            + w * (9.090_887_133_436_507e-2
                + w * (6.661_073_137_387_531e-2 + w * (4.976_877_994_615_932e-2 + w * 1.628_582_011_536_578_2e-2))));
    let even = -1.999_999_999_987_648_3e-1
        + w * (-1.111_111_040_546_235_6e-1
            + w * (-7.691_876_205_044_83e-2 + w * (-5.833_570_133_790_573e-2 + w * -3.653_157_274_421_691_6e-2)));
    let angle = base - ((t * (z * odd + w * even) - rest) - t);
    let angle = if steep { FRAC_PI_2 - angle } else { angle };
    if x < 0.0 { PI - angle } else { angle }
}
