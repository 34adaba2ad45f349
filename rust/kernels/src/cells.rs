//! Lookup in a material on cells: the same formulas, in the same order, as `reflectance/cells.py`.

use crate::lookup::{BATCH, Material, Pairs, Room, half_diff};

/// A material on cells.
pub struct CellMaterial<'a> {
    /// Where the cells are.
    pub lattice: CellLattice,
    /// What they hold.
    pub cells: Cells<'a>,
}

/// The lattice, and how to look up in it.
#[derive(Clone, Copy)]
pub struct CellLattice {
    /// The number of bins in θ_h, θ_d and φ_d.
    pub bins: [usize; 3],
    /// Whether both orders of the directions fall into the same cell.
    pub reciprocal: bool,
    /// Whether the values of cells are interpolated. Otherwise the nearest cell counts.
    pub trilinear: bool,
}

/// What the cells hold, in the order of their numbers.
#[derive(Clone, Copy)]
pub enum Cells<'a> {
    /// f_r of each cell.
    Values(&'a [f64]),
    /// The number of each cell's LUT entry, and the entries: NaN is looked up where there is no such entry.
    Index8(&'a [u8], &'a [f64]),
    /// The same with 16 bits.
    Index16(&'a [u16], &'a [f64]),
}

#[allow(clippy::len_without_is_empty)]
impl Cells<'_> {
    /// The number of cells.
    pub fn len(&self) -> usize {
        match self {
            Cells::Values(values) => values.len() / 3,
            Cells::Index8(index, _) => index.len(),
            Cells::Index16(index, _) => index.len(),
        }
    }

    /// Whether the values are triples.
    pub fn are_triples(&self) -> bool {
        let (Cells::Values(values) | Cells::Index8(_, values) | Cells::Index16(_, values)) = self;
        values.len().is_multiple_of(3)
    }
}

impl Material for CellMaterial<'_> {
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

impl CellMaterial<'_> {
    /// f_r of one pair, whose components are finite and which is above the horizon.
    pub fn eval(&self, wi: [f64; 3], wo: [f64; 3]) -> [f64; 3] {
        let at = position(wi, wo, self.lattice);
        match self.cells {
            Cells::Values(values) => self.lattice.value(at, |cell| triple(values, cell)),
            Cells::Index8(index, lut) => self.lattice.value(at, |cell| triple(lut, index[cell] as usize)),
            Cells::Index16(index, lut) => self.lattice.value(at, |cell| triple(lut, index[cell] as usize)),
        }
    }
}

impl CellLattice {
    /// What is looked up at continuous bin numbers.
    #[inline(always)]
    fn value(self, at: [f64; 3], get: impl Fn(usize) -> [f64; 3]) -> [f64; 3] {
        if self.trilinear { trilinear(at, self.bins, get) } else { get(nearest(at, self.bins) as u32 as usize) }
    }
}

/// Loads a cache line before it is needed: a table is larger than the caches, and its cells are read in no order.
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
fn fill(pairs: &Pairs, lattice: CellLattice, at: &Room, out: &mut [[f64; 3]], get: impl Fn(usize) -> [f64; 3]) {
    for (i, value) in out.iter_mut().enumerate().take(BATCH) {
        let found = if lattice.trilinear {
            trilinear([at[0][i], at[1][i], at[2][i]], lattice.bins, &get)
        } else {
            get(at[0][i] as u32 as usize)
        };
        *value = pairs.known(i).map_or(found, |known| [known; 3]);
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
fn positions(pairs: &Pairs, lattice: CellLattice, at: &mut Room) {
    if lattice.trilinear {
        positions_for::<true>(pairs, lattice, at)
    } else {
        positions_for::<false>(pairs, lattice, at)
    }
}

#[inline(always)]
fn positions_for<const TRILINEAR: bool>(pairs: &Pairs, lattice: CellLattice, at: &mut Room) {
    for i in 0..BATCH {
        let (wi, wo) = pairs.directions(i);
        let position = position(wi, wo, lattice);
        let cell = nearest(position, lattice.bins);
        let numbers = if TRILINEAR { &position[..] } else { &[cell] };
        for (at, &number) in at.iter_mut().zip(numbers) {
            at[i] = number;
        }
    }
}

/// Continuous bin numbers of a pair.
#[inline(always)]
fn position(wi: [f64; 3], wo: [f64; 3], lattice: CellLattice) -> [f64; 3] {
    let half_pi = std::f64::consts::FRAC_PI_2;
    let [bins_h, bins_d, bins_p] = lattice.bins.map(|n| n as f64);
    let range = if lattice.reciprocal { std::f64::consts::PI } else { std::f64::consts::TAU };
    let [theta_h, theta_d, phi_d] = half_diff(wi, wo, lattice.reciprocal, false);
    let u = bins_h * (theta_h * (1.0 / half_pi)).sqrt();
    let (v, w) = (theta_d * (bins_d / half_pi), phi_d * (bins_p / range));
    [u, v, if w > 0.0 { w } else { 0.0 }] // where lengths overflow, it is no number
}

/// The number of the cell that continuous bin numbers lie in.
#[inline(always)]
fn nearest([u, v, w]: [f64; 3], bins: [usize; 3]) -> f64 {
    let [bins_h, bins_d, bins_p] = bins.map(|n| n as f64);
    let bin = |position: f64, bins: f64| position.min(bins - 1.0).floor();
    bin(w, bins_p) + bins_p * (bin(v, bins_d) + bins_d * bin(u, bins_h))
}
