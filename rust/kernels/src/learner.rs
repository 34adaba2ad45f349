//! Phases 1 and 2 of the paper: the SOM and, for each of its units, the MAN of three stored originals.
//!
//! The arithmetic is 32-bit, in the order written here, without fused multiply-add, and is the same,
//! bit for bit, as in `python/sommerl/compression/paper/reference.py`.

use std::ops::Range;

use sommerl_simd::{InstructionSet, Simd, for_each_instruction_set};

use crate::codebook::{Codebook, squared_distance};

/// Stored originals of a unit (the paper's k).
pub const STORED: usize = 3;
/// The cell number of a storage slot that holds nothing yet.
pub const EMPTY: u32 = u32::MAX;

/// The stored originals of one unit. Lane 3 is for the triple that is being presented.
#[derive(Clone, Copy, PartialEq)]
#[repr(C, align(64))]
struct Originals {
    x: [[f32; 4]; 3],
    cell: [u32; 4],
}

impl Originals {
    /// The slot that holds a cell, if one does.
    fn slot_of(&self, cell: u32) -> Option<usize> {
        self.cell[..STORED].iter().position(|&stored| stored == cell)
    }
}

/// The learning rule for the weights.
#[derive(Clone, Copy, PartialEq)]
pub enum Rule {
    /// Eq. 2 as printed, with its factor x.
    Paper,
    /// Without that factor.
    Kohonen,
}

/// How the winner is found. It is the same in each way.
#[derive(Clone, Copy, PartialEq)]
pub enum Search {
    /// In the boxes that may hold it, starting from the last epoch's winner.
    Boxes,
    /// Among all units, sixteen at a time. This is fastest when all units move.
    All,
    /// Among all units, one by one, as a textbook does.
    Scalar,
}

/// Everything that stays the same during one epoch.
pub struct Epoch<'a> {
    /// The learning rate.
    pub alpha: f32,
    /// Gaussian weights by distance along an axis of the sheet; a single 1 means that only the winner learns.
    pub falloff: &'a [f32],
}

/// The units of the SOM and their MANs, in training.
pub struct Learner {
    /// What the cells hold, and their numbers, in the order of presentation.
    triples: Vec<[f32; 3]>,
    cells: Vec<u32>,
    /// The winner of each in the last epoch; at first, EMPTY.
    winners: Vec<u32>,
    /// In the first epoch, the last winner of a similar triple.
    similar: Vec<u32>,
    weights: Codebook,
    stored: Vec<Originals>,
    /// Whether any weight has changed in this epoch, and what was stored before it.
    moved: bool,
    before: Vec<Originals>,
    /// The learning rule.
    pub rule: Rule,
    /// Whether a cell that a unit has stored takes its own place when it comes back, instead of another slot.
    pub distinct: bool,
    /// Units in a row of the sheet; a chain is a sheet of one row.
    pub columns: usize,
    /// The instruction set to use.
    pub set: InstructionSet,
    /// How winners are found.
    pub search: Search,
}

#[allow(clippy::len_without_is_empty)]
impl Learner {
    /// triples: what the cells hold, and the cells' numbers, in the order of presentation. weights: the units' first ones.
    pub fn new(triples: Vec<[f32; 3]>, cells: Vec<u32>, weights: &[[f32; 3]]) -> Self {
        let nothing = Originals { x: [[f32::INFINITY; 4]; 3], cell: [EMPTY; 4] };
        let stored = vec![nothing; weights.len()];
        Learner {
            winners: vec![EMPTY; triples.len()],
            similar: vec![0; 1 << SIMILAR_BITS],
            triples,
            cells,
            weights: Codebook::new(weights),
            before: stored.clone(),
            stored,
            moved: false,
            rule: Rule::Kohonen,
            distinct: false,
            columns: weights.len(),
            set: InstructionSet::fastest(),
            search: Search::Boxes,
        }
    }

    /// The number of triples.
    pub fn len(&self) -> usize {
        self.triples.len()
    }

    /// The units' weights.
    pub fn weights(&self) -> Vec<[f32; 3]> {
        self.weights.entries()
    }

    /// Cell numbers of each unit's stored originals, slot by slot; `EMPTY` where a slot holds nothing.
    pub fn stored_cells(&self) -> Vec<[u32; STORED]> {
        self.stored.iter().map(|unit| [unit.cell[0], unit.cell[1], unit.cell[2]]).collect()
    }

    /// To be asked at the end of each epoch: whether it changed no weight and no stored original. Then later epochs change nothing
    /// either: with a smaller α each step is smaller, and a step that was rounded to nothing still is.
    pub fn settled(&mut self) -> bool {
        let settled = !self.moved && self.stored == self.before;
        self.moved = false;
        self.before.copy_from_slice(&self.stored);
        settled
    }

    /// Presents a range of the order. Returns the sum of the distances to the winners' weights.
    pub fn present(&mut self, range: Range<usize>, epoch: &Epoch) -> f64 {
        if self.search == Search::Boxes && epoch.falloff.len() == 1 {
            self.weights.rearrange();
        } else {
            self.weights.order();
        }
        present(self.set, self, range, epoch)
    }

    #[inline(always)]
    unsafe fn present_all<S: Simd>(&mut self, range: Range<usize>, epoch: &Epoch) -> f64 {
        unsafe {
            match (self.rule, epoch.falloff.len()) {
                (Rule::Paper, 1) => self.present_each::<S, true, false>(range, epoch),
                (Rule::Paper, _) => self.present_each::<S, true, true>(range, epoch),
                (Rule::Kohonen, 1) => self.present_each::<S, false, false>(range, epoch),
                (Rule::Kohonen, _) => self.present_each::<S, false, true>(range, epoch),
            }
        }
    }

    #[inline(always)]
    unsafe fn present_each<S: Simd, const PAPER: bool, const NEIGHBOURS: bool>(
        &mut self,
        range: Range<usize>,
        epoch: &Epoch,
    ) -> f64 {
        let mut total = 0.0;
        let mut watch = Watch::default();
        for k in range {
            if !NEIGHBOURS && watch.loose() {
                self.weights.rearrange();
            }
            let x = self.triples[k];
            let (winner, squared) = match self.search {
                Search::Boxes if !NEIGHBOURS => unsafe { self.winner::<S>(k, x, &mut watch) },
                Search::Scalar => one_by_one(&self.weights, x),
                _ => unsafe { self.weights.nearest_of_all::<S>(x) },
            };
            total += f64::from(squared).sqrt();
            let old = self.weights.get(winner);
            let learnt = moved::<PAPER>(old, x, epoch.alpha);
            if NEIGHBOURS {
                self.move_neighbours::<PAPER>(winner, x, epoch);
            }
            let (stored, cell) = (&mut self.stored[winner], self.cells[k]);
            let own = if self.distinct { stored.slot_of(cell) } else { None };
            let weight = attract::<PAPER>(stored, own, learnt, x, cell, epoch.alpha);
            // Two steps that cancel count as movement: smaller ones may not cancel.
            self.moved |= (learnt != old) | (weight != learnt);
            self.weights.set(winner, weight);
        }
        total
    }

    /// The winner of presentation k. The search starts from a guess: the winner of the same cell in the last epoch. Where units move
    /// so far that many cells change their winners, it is the nearest of three: that one, the last winner of a similar triple, and
    /// the winner of the presentation before.
    #[inline(always)]
    unsafe fn winner<S: Simd>(&mut self, k: usize, x: [f32; 3], watch: &mut Watch) -> (usize, f32) {
        let mut guess = self.winners[k];
        let unsteady = watch.unsteady || guess == EMPTY;
        if unsteady {
            let mut nearest = f32::INFINITY;
            for unit in [self.winners[k], self.similar[similar_to(x)], self.winners[k.saturating_sub(1)]] {
                if unit == EMPTY {
                    continue;
                }
                let distance = squared_distance(x, self.weights.get(unit as usize));
                if distance < nearest {
                    (guess, nearest) = (unit, distance);
                }
            }
        }
        let found = unsafe { self.weights.nearest::<S>(x, guess as usize, &mut watch.work) };
        watch.missed += usize::from(found.0 != self.winners[k] as usize);
        if unsteady {
            self.similar[similar_to(x)] = found.0 as u32;
        }
        self.winners[k] = found.0 as u32;
        found
    }

    /// Phase 1 for the winner's neighbours on the sheet: Eq. 2, more weakly.
    fn move_neighbours<const PAPER: bool>(&mut self, winner: usize, x: [f32; 3], epoch: &Epoch) {
        let reach = epoch.falloff.len() - 1;
        let (row, column) = (winner / self.columns, winner % self.columns);
        let rows = self.weights.len().div_ceil(self.columns);
        for r in row.saturating_sub(reach)..rows.min(row + reach + 1) {
            for c in column.saturating_sub(reach)..self.columns.min(column + reach + 1) {
                let unit = r * self.columns + c;
                if unit == winner || unit >= self.weights.len() {
                    continue;
                }
                let falloff = epoch.falloff[r.abs_diff(row)] * epoch.falloff[c.abs_diff(column)];
                let old = self.weights.get(unit);
                let weight = moved::<PAPER>(old, x, epoch.alpha * falloff);
                self.moved |= weight != old;
                self.weights.set(unit, weight);
            }
        }
    }
}

for_each_instruction_set! {
    fn present(learner: &mut Learner, range: Range<usize>, epoch: &Epoch) -> f64 {
        // SAFETY: the function is compiled for the instruction set of `Lanes`.
        unsafe { learner.present_all::<Lanes>(range, epoch) }
    }
}

/// Watches over the search, window by window of presentations.
#[derive(Default)]
struct Watch {
    presented: usize,
    /// Blocks looked into, and how many of them when the boxes were new.
    work: usize,
    when_new: Option<usize>,
    /// Cells whose winner is not that of the last epoch; whether they were many in the last window.
    missed: usize,
    unsteady: bool,
}

impl Watch {
    const WINDOW: usize = 1024;

    /// To be asked before each presentation: whether the boxes, which grow as units move, have become so large that it is worth the
    /// time to make new ones. The caller then does.
    #[inline(always)]
    fn loose(&mut self) -> bool {
        self.presented += 1;
        if self.presented <= Self::WINDOW {
            return false;
        }
        self.presented = 1;
        self.unsteady = std::mem::take(&mut self.missed) > Self::WINDOW / 8;
        let work = std::mem::take(&mut self.work);
        let loose = work > 2 * *self.when_new.get_or_insert(work) + Self::WINDOW;
        if loose {
            self.when_new = None;
        }
        loose
    }
}

/// Phase 2: Eq. 3 to 6. A slot that holds nothing is infinitely far away. `own` is the slot to use instead of the farthest.
/// Returns the winner's new weight.
#[inline(always)]
fn attract<const PAPER: bool>(
    stored: &mut Originals,
    own: Option<usize>,
    weight: [f32; 3],
    x: [f32; 3],
    cell: u32,
    alpha: f32,
) -> [f32; 3] {
    for (lanes, value) in stored.x.iter_mut().zip(x) {
        lanes[3] = value;
    }
    let distance: [f32; 4] = std::array::from_fn(|i| {
        let [r, g, b] = std::array::from_fn(|j| stored.x[j][i] - weight[j]);
        (r * r + g * g) + b * b
    });
    let mut farthest = usize::from(distance[1] > distance[0]);
    farthest = if distance[2] > distance[farthest] { 2 } else { farthest };
    farthest = own.unwrap_or(farthest);
    let replaces = distance[3] <= distance[farthest];
    let attractor: [f32; 3] = std::array::from_fn(|j| if replaces { x[j] } else { stored.x[j][farthest] });
    if replaces {
        for (lanes, value) in stored.x.iter_mut().zip(x) {
            lanes[farthest] = value;
        }
        stored.cell[farthest] = cell;
    }
    moved::<PAPER>(weight, attractor, alpha)
}

/// Eq. 2 (and, with a stored original for x, Eq. 6): c + (α x) (x - c), or c + α (x - c) under Kohonen's rule.
#[inline(always)]
fn moved<const PAPER: bool>(c: [f32; 3], x: [f32; 3], alpha: f32) -> [f32; 3] {
    std::array::from_fn(|j| {
        let rate = if PAPER { alpha * x[j] } else { alpha };
        c[j] + rate * (x[j] - c[j])
    })
}

fn one_by_one(weights: &Codebook, x: [f32; 3]) -> (usize, f32) {
    let mut best = (0, f32::INFINITY);
    for unit in 0..weights.len() {
        let d = squared_distance(x, weights.get(unit));
        if d < best.1 {
            best = (unit, d);
        }
    }
    best
}

const SIMILAR_BITS: u32 = 14;

/// A hash of exponents and leading bits of mantissas, so that triples of about the same colour and brightness have the same.
#[inline(always)]
fn similar_to(x: [f32; 3]) -> usize {
    let [r, g, b] = x.map(|v| v.to_bits() >> 20);
    let mixed = (r | (g << 11)).wrapping_mul(0x9E37_79B1) ^ b.wrapping_mul(0x85EB_CA6B);
    (mixed.wrapping_mul(0xC2B2_AE35) >> (32 - SIMILAR_BITS)) as usize
}
