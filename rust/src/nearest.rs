//! Nearest codeword (Eq. 1) by comparing with every one of them.

const LANES: usize = 16;

/// Squared Euclidean distance, summed as (r² + g²) + b².
#[inline(always)]
pub fn squared_distance(x: [f32; 3], c: [f32; 3]) -> f32 {
    let [r, g, b] = [x[0] - c[0], x[1] - c[1], x[2] - c[2]];
    (r * r + g * g) + b * b
}

/// A list of triples, kept channel by channel in blocks of `LANES` so that the search vectorises.
pub struct Codebook {
    length: usize,
    blocks: Vec<[[f32; LANES]; 3]>,
}

impl Codebook {
    /// Padding is infinitely far from everything and is never the nearest.
    pub fn new(entries: &[[f32; 3]]) -> Self {
        let blocks = vec![[[f32::INFINITY; LANES]; 3]; entries.len().div_ceil(LANES)];
        let mut codebook = Codebook { length: entries.len(), blocks };
        for (i, &entry) in entries.iter().enumerate() {
            codebook.set(i, entry);
        }
        codebook
    }

    pub fn len(&self) -> usize {
        self.length
    }

    #[inline(always)]
    pub fn get(&self, i: usize) -> [f32; 3] {
        self.blocks[i / LANES].map(|channel| channel[i % LANES])
    }

    #[inline(always)]
    pub fn set(&mut self, i: usize, entry: [f32; 3]) {
        for (channel, value) in self.blocks[i / LANES].iter_mut().zip(entry) {
            channel[i % LANES] = value;
        }
    }

    pub fn entries(&self) -> Vec<[f32; 3]> {
        (0..self.length).map(|i| self.get(i)).collect()
    }

    /// Number of the nearest entry, the lowest one of several, and its squared distance.
    #[inline(always)]
    pub fn nearest(&self, x: [f32; 3]) -> (usize, f32) {
        let mut distance = [f32::INFINITY; LANES];
        let mut found = [0u32; LANES];
        for (number, block) in self.blocks.iter().enumerate() {
            for lane in 0..LANES {
                let d = squared_distance(x, [block[0][lane], block[1][lane], block[2][lane]]);
                let nearer = d < distance[lane];
                distance[lane] = if nearer { d } else { distance[lane] };
                found[lane] = if nearer { number as u32 } else { found[lane] };
            }
        }
        let mut best = (found[0] as usize * LANES, distance[0]);
        for lane in 1..LANES {
            let candidate = (found[lane] as usize * LANES + lane, distance[lane]);
            if candidate.1 < best.1 || (candidate.1 == best.1 && candidate.0 < best.0) {
                best = candidate;
            }
        }
        best
    }

    /// Phase 3: the nearest entry of each triple.
    pub fn query(&self, triples: &[[f32; 3]]) -> Vec<u32> {
        #[cfg(target_arch = "x86_64")]
        if std::is_x86_feature_detected!("avx2") {
            // SAFETY: the processor has the one feature that the function is compiled for.
            return unsafe { self.query_avx2(triples) };
        }
        self.query_all(triples)
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn query_avx2(&self, triples: &[[f32; 3]]) -> Vec<u32> {
        self.query_all(triples)
    }

    #[inline(always)]
    fn query_all(&self, triples: &[[f32; 3]]) -> Vec<u32> {
        triples.iter().map(|&x| self.nearest(x).0 as u32).collect()
    }
}
