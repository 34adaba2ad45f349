//! The nearest of several entries (Eq. 1), found exactly: by comparing with all, or with those in the boxes that can hold it.

use sommerl_simd::{Line, Simd};

/// Squared Euclidean distance, summed as (r² + g²) + b².
#[inline(always)]
pub fn squared_distance(x: [f32; 3], c: [f32; 3]) -> f32 {
    let [r, g, b] = [x[0] - c[0], x[1] - c[1], x[2] - c[2]];
    (r * r + g * g) + b * b
}

#[inline(always)]
unsafe fn squared_distances<S: Simd>(x: [S::V; 3], lines: &[Line; 3]) -> S::V {
    unsafe {
        // No closures here: they would not be compiled for the instructions that `S` needs.
        let r = S::sub(x[0], S::load(&lines[0]));
        let g = S::sub(x[1], S::load(&lines[1]));
        let b = S::sub(x[2], S::load(&lines[2]));
        S::add(S::add(S::mul(r, r), S::mul(g, g)), S::mul(b, b))
    }
}

#[inline(always)]
unsafe fn splats<S: Simd>(x: [f32; 3]) -> [S::V; 3] {
    unsafe { [S::splat(x[0]), S::splat(x[1]), S::splat(x[2])] }
}

/// Entries in blocks of sixteen, and a box around each block. Padding is infinitely far from everything.
///
/// A box's lower bound is computed with the same operations in the same order as a distance. Rounding is monotonic, so it is
/// at most the distance of any entry in the box, in floating point too: no slack is needed, and the search is exact.
pub struct Codebook {
    blocks: Vec<[Line; 3]>,
    /// Entry numbers by slot, and slots by entry number.
    entry: Vec<u32>,
    slot: Vec<u32>,
    /// Lower and upper bounds of sixteen boxes at a time.
    boxes: Vec<[[Line; 3]; 2]>,
    /// Whether slots are other than entries' numbers.
    rearranged: bool,
}

const FAR: Line = Line([f32::INFINITY; 16]);

impl Codebook {
    /// In the order given, for `nearest_of_all`; `rearrange` makes boxes tight, for `nearest`.
    pub fn new(entries: &[[f32; 3]]) -> Self {
        let slot = vec![0; entries.len()];
        let mut codebook = Codebook { blocks: vec![], entry: vec![], slot, boxes: vec![], rearranged: false };
        codebook.fill_in_order(entries);
        codebook
    }

    /// Back to the first order.
    pub fn order(&mut self) {
        if self.rearranged {
            self.rearranged = false;
            self.fill_in_order(&self.entries());
        }
    }

    fn fill_in_order(&mut self, entries: &[[f32; 3]]) {
        let numbers: Vec<u32> = (0..entries.len() as u32).collect();
        self.fill(entries, &numbers.chunks(16).map(<[u32]>::to_vec).collect::<Vec<_>>());
    }

    pub fn len(&self) -> usize {
        self.slot.len()
    }

    #[inline(always)]
    pub fn get(&self, entry: usize) -> [f32; 3] {
        self.at(self.slot[entry] as usize)
    }

    #[inline(always)]
    fn at(&self, slot: usize) -> [f32; 3] {
        let block = &self.blocks[slot / 16];
        [block[0].0[slot % 16], block[1].0[slot % 16], block[2].0[slot % 16]]
    }

    /// Changes an entry; its box grows if it has to.
    #[inline(always)]
    pub fn set(&mut self, entry: usize, value: [f32; 3]) {
        let slot = self.slot[entry] as usize;
        let (block, lane) = (slot / 16, slot % 16);
        for (line, v) in self.blocks[block].iter_mut().zip(value) {
            line.0[lane] = v;
        }
        let [low, high] = &mut self.boxes[block / 16];
        let b = block % 16;
        let outside = (0..3).any(|j| (value[j] < low[j].0[b]) | (value[j] > high[j].0[b]));
        if outside {
            for j in 0..3 {
                low[j].0[b] = low[j].0[b].min(value[j]);
                high[j].0[b] = high[j].0[b].max(value[j]);
            }
        }
    }

    pub fn entries(&self) -> Vec<[f32; 3]> {
        (0..self.len()).map(|entry| self.get(entry)).collect()
    }

    /// Arranges the entries anew into tight boxes: a k-d tree's leaves, split at the median of the widest axis.
    pub fn rearrange(&mut self) {
        let entries = self.entries();
        let mut numbers: Vec<u32> = (0..entries.len() as u32).collect();
        let mut leaves = vec![];
        split(&mut numbers, &entries, &mut leaves);
        self.rearranged = true;
        self.fill(&entries, &leaves);
    }

    fn fill(&mut self, entries: &[[f32; 3]], leaves: &[Vec<u32>]) {
        self.blocks = vec![[FAR; 3]; leaves.len()];
        self.entry = vec![u32::MAX; 16 * leaves.len()];
        self.boxes = vec![[[FAR; 3]; 2]; leaves.len().div_ceil(16)];
        for (block, leaf) in leaves.iter().enumerate() {
            for (lane, &number) in leaf.iter().enumerate() {
                let value = entries[number as usize];
                self.entry[16 * block + lane] = number;
                self.slot[number as usize] = (16 * block + lane) as u32;
                let [low, high] = &mut self.boxes[block / 16];
                for j in 0..3 {
                    self.blocks[block][j].0[lane] = value[j];
                    let (l, h) = (&mut low[j].0[block % 16], &mut high[j].0[block % 16]);
                    *l = l.min(value[j]);
                    *h = if lane == 0 { value[j] } else { h.max(value[j]) };
                }
            }
        }
    }

    /// The nearest entry, the lowest of several, and its squared distance, by comparing with all of them. Only for entries
    /// in their first order: of equal distances in one lane, it is the first block's that counts.
    #[inline(always)]
    pub unsafe fn nearest_of_all<S: Simd>(&self, x: [f32; 3]) -> (usize, f32) {
        unsafe {
            let v = splats::<S>(x);
            let (mut distance, mut found) = (S::splat(f32::INFINITY), S::splat(0.0));
            for (number, block) in self.blocks.iter().enumerate() {
                let d = squared_distances::<S>(v, block);
                found = S::select_lt(d, distance, S::splat(number as f32), found);
                distance = S::min(d, distance);
            }
            let best = S::smallest(distance);
            let mut lanes = S::le(distance, S::splat(best));
            let found = S::store(found);
            let mut nearest = usize::MAX;
            while lanes != 0 {
                let lane = lanes.trailing_zeros() as usize;
                nearest = nearest.min(16 * found.0[lane] as usize + lane);
                lanes &= lanes - 1;
            }
            (nearest, best)
        }
    }

    /// The same, given an entry that it may well be. Adds the number of blocks looked into beside the guess's to `work`.
    #[inline(always)]
    pub unsafe fn nearest<S: Simd>(&self, x: [f32; 3], guess: usize, work: &mut usize) -> (usize, f32) {
        unsafe {
            let slot = self.slot[guess] as usize;
            let (own, lane) = (slot / 16, slot % 16);
            let distance = squared_distance(x, self.at(slot));
            let (v, bound) = (splats::<S>(x), S::splat(distance));
            if S::le(squared_distances::<S>(v, &self.blocks[own]), bound) & !(1 << lane) != 0 {
                return self.nearest_in_boxes::<S>(x, own);
            }
            // Branches and not choices of values: the processor goes on with the guess while this is still being verified.
            for (group, bounds) in self.boxes.iter().enumerate() {
                let mut near = S::le(lower_bounds::<S>(v, bounds), bound);
                if group == own / 16 {
                    near &= !(1 << (own % 16));
                }
                while near != 0 {
                    let block = 16 * group + near.trailing_zeros() as usize;
                    if S::le(squared_distances::<S>(v, &self.blocks[block]), bound) != 0 {
                        return self.nearest_in_boxes::<S>(x, block);
                    }
                    near &= near - 1;
                    *work += 1;
                }
            }
            (guess, distance)
        }
    }

    /// The same, starting from a block that is likely to hold it.
    #[inline(always)]
    unsafe fn nearest_in_boxes<S: Simd>(&self, x: [f32; 3], own: usize) -> (usize, f32) {
        unsafe {
            let v = splats::<S>(x);
            let mut best = (usize::MAX, f32::INFINITY);
            self.improve::<S>(v, own, &mut best);
            for (group, bounds) in self.boxes.iter().enumerate() {
                let bound = lower_bounds::<S>(v, bounds);
                let mut near = S::le(bound, S::splat(best.1));
                if group == own / 16 {
                    near &= !(1 << (own % 16));
                }
                while near != 0 {
                    self.improve::<S>(v, 16 * group + near.trailing_zeros() as usize, &mut best);
                    near &= near - 1;
                    near &= S::le(bound, S::splat(best.1));
                }
            }
            best
        }
    }

    #[inline(always)]
    unsafe fn improve<S: Simd>(&self, v: [S::V; 3], block: usize, best: &mut (usize, f32)) {
        unsafe {
            let d = squared_distances::<S>(v, &self.blocks[block]);
            if S::le(d, S::splat(best.1)) == 0 {
                return;
            }
            let smallest = S::smallest(d);
            let mut lanes = S::le(d, S::splat(smallest));
            while lanes != 0 {
                let entry = self.entry[16 * block + lanes.trailing_zeros() as usize] as usize;
                if smallest < best.1 || entry < best.0 {
                    *best = (entry, smallest);
                }
                lanes &= lanes - 1;
            }
        }
    }
}

/// Squared distances from x to sixteen boxes.
#[inline(always)]
unsafe fn lower_bounds<S: Simd>(x: [S::V; 3], [low, high]: &[[Line; 3]; 2]) -> S::V {
    unsafe {
        let r = beyond::<S>(x[0], &low[0], &high[0]);
        let g = beyond::<S>(x[1], &low[1], &high[1]);
        let b = beyond::<S>(x[2], &low[2], &high[2]);
        S::add(S::add(S::mul(r, r), S::mul(g, g)), S::mul(b, b))
    }
}

/// How far x lies outside of the intervals from low to high.
#[inline(always)]
unsafe fn beyond<S: Simd>(x: S::V, low: &Line, high: &Line) -> S::V {
    unsafe { S::max(S::max(S::sub(S::load(low), x), S::sub(x, S::load(high))), S::splat(0.0)) }
}

fn split(numbers: &mut [u32], entries: &[[f32; 3]], leaves: &mut Vec<Vec<u32>>) {
    if numbers.len() <= 16 {
        leaves.push(numbers.to_vec());
        return;
    }
    let extent = |j: usize| {
        let values = numbers.iter().map(|&n| entries[n as usize][j]);
        let (low, high) = values.fold((f32::INFINITY, f32::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
        high - low
    };
    let mut axis = 0;
    for j in 1..3 {
        if extent(j) > extent(axis) {
            axis = j;
        }
    }
    // Halves of whole blocks, so that all but the last are full.
    let middle = numbers.len().div_ceil(16).div_ceil(2) * 16;
    numbers.select_nth_unstable_by(middle, |&a, &b| entries[a as usize][axis].total_cmp(&entries[b as usize][axis]));
    let (left, right) = numbers.split_at_mut(middle);
    split(left, entries, leaves);
    split(right, entries, leaves);
}
