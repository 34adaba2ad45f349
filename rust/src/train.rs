//! Phases 1 and 2 of the paper: the SOM and, for each of its units, the MAN of three stored originals.
//!
//! The arithmetic is 32-bit, in the order written here, without fused multiply-add, and is the same,
//! bit for bit, as in `python/sommerl/som_man/reference.py`.

use crate::nearest::{Codebook, squared_distance};

/// Stored originals of a unit (the paper's k).
pub const STORED: usize = 3;
/// The cell number of a storage slot that holds nothing yet.
pub const EMPTY: u32 = u32::MAX;

#[derive(Clone, Copy)]
struct Original {
    x: [f32; 3],
    cell: u32,
}

/// Learning rule for the weights: Eq. 2 with its factor x (`paper`) or without it (`kohonen`).
#[derive(Clone, Copy, PartialEq)]
pub enum Rule {
    Paper,
    Kohonen,
}

/// Everything that stays the same during one epoch.
pub struct Epoch<'a> {
    pub rule: Rule,
    pub alpha: f32,
    /// Gaussian weights by distance along an axis of the sheet; a single 1 means that only the winner learns.
    pub falloff: &'a [f32],
    /// Units in a row of the sheet; a chain is a sheet of one row.
    pub columns: usize,
}

pub struct Learner {
    triples: Vec<[f32; 3]>,
    weights: Codebook,
    stored: Vec<[Original; STORED]>,
}

impl Learner {
    pub fn new(triples: Vec<[f32; 3]>, weights: &[[f32; 3]]) -> Self {
        let nothing = Original { x: [0.0; 3], cell: EMPTY };
        Learner { triples, weights: Codebook::new(weights), stored: vec![[nothing; STORED]; weights.len()] }
    }

    pub fn cells(&self) -> usize {
        self.triples.len()
    }

    pub fn weights(&self) -> Vec<[f32; 3]> {
        self.weights.entries()
    }

    /// Cell numbers of each unit's stored originals, slot by slot; `EMPTY` where a slot holds nothing.
    pub fn stored_cells(&self) -> Vec<[u32; STORED]> {
        self.stored.iter().map(|unit| unit.map(|original| original.cell)).collect()
    }

    /// Presents the given cells in order. Returns the sum of the distances to their winners.
    pub fn present(&mut self, cells: &[u32], epoch: &Epoch) -> f64 {
        #[cfg(target_arch = "x86_64")]
        if std::is_x86_feature_detected!("avx2") {
            // SAFETY: the processor has the one feature that the function is compiled for.
            return unsafe { self.present_avx2(cells, epoch) };
        }
        self.present_all(cells, epoch)
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn present_avx2(&mut self, cells: &[u32], epoch: &Epoch) -> f64 {
        self.present_all(cells, epoch)
    }

    #[inline(always)]
    fn present_all(&mut self, cells: &[u32], epoch: &Epoch) -> f64 {
        let mut distance = 0.0;
        for &cell in cells {
            let x = self.triples[cell as usize];
            let (winner, squared) = self.weights.nearest(x);
            distance += f64::from(squared).sqrt();
            self.learn(winner, x, epoch);
            self.attract(winner, x, cell, epoch);
        }
        distance
    }

    /// Phase 1: Eq. 2 for the winner and, more weakly, for its neighbours on the sheet.
    #[inline(always)]
    fn learn(&mut self, winner: usize, x: [f32; 3], epoch: &Epoch) {
        self.weights.set(winner, moved(self.weights.get(winner), x, epoch.alpha, epoch.rule));
        let reach = epoch.falloff.len() - 1;
        if reach == 0 {
            return;
        }
        let (row, column) = (winner / epoch.columns, winner % epoch.columns);
        let rows = self.weights.len().div_ceil(epoch.columns);
        for r in row.saturating_sub(reach)..rows.min(row + reach + 1) {
            for c in column.saturating_sub(reach)..epoch.columns.min(column + reach + 1) {
                let unit = r * epoch.columns + c;
                if unit == winner || unit >= self.weights.len() {
                    continue;
                }
                let weight = epoch.falloff[r.abs_diff(row)] * epoch.falloff[c.abs_diff(column)];
                let alpha = epoch.alpha * weight;
                self.weights.set(unit, moved(self.weights.get(unit), x, alpha, epoch.rule));
            }
        }
    }

    /// Phase 2: Eq. 3 to 6. A slot that holds nothing counts as infinitely far away.
    #[inline(always)]
    fn attract(&mut self, winner: usize, x: [f32; 3], cell: u32, epoch: &Epoch) {
        let weight = self.weights.get(winner);
        let stored = &mut self.stored[winner];
        let (mut farthest, mut distance) = (0, f32::NEG_INFINITY);
        for (slot, original) in stored.iter().enumerate() {
            let d = if original.cell == EMPTY { f32::INFINITY } else { squared_distance(original.x, weight) };
            if d > distance {
                (farthest, distance) = (slot, d);
            }
        }
        if squared_distance(x, weight) <= distance {
            stored[farthest] = Original { x, cell };
        }
        let attractor = stored[farthest].x;
        self.weights.set(winner, moved(weight, attractor, epoch.alpha, epoch.rule));
    }
}

/// Eq. 2 (and, with a stored original for x, Eq. 6): c + (α x) (x - c), or c + α (x - c) under Kohonen's rule.
#[inline(always)]
fn moved(c: [f32; 3], x: [f32; 3], alpha: f32, rule: Rule) -> [f32; 3] {
    std::array::from_fn(|j| {
        let rate = if rule == Rule::Paper { alpha * x[j] } else { alpha };
        c[j] + rate * (x[j] - c[j])
    })
}
