//! Lookup of many pairs of directions on a lattice of nodes: the same formulas, in the same order, as `nodes.py`, but with
//! divisions by the nodes' distances done beforehand.

use crate::eval::{BATCH, Material, Pairs, Room};

/// Constants as in `nodes.py`.
const FINE: usize = 180;
const KNEE: f64 = 90.0;
const BELOW: f64 = 360.0;
const ABOVE: f64 = 120.0;
const SMALLEST_COSINE: f64 = 0.01;

/// Between which nodes of an axis a step of the fine grid lies.
#[derive(Clone, Copy)]
struct Step {
    /// The two nodes, counted from the axis' first in nodes of the lattice.
    below: u32,
    after: u32,
    place: f64,
    per_width: f64,
}

impl Step {
    /// How far x lies from the node below to the one after.
    #[inline(always)]
    fn share(&self, x: f64) -> f64 {
        ((x - self.place) * self.per_width).clamp(0.0, 1.0)
    }
}

/// One for every byte, so that none leads outside: those beyond the fine grid are as its last.
type Axis = [Step; 256];

/// Nodes in θ_d and φ_d, which the rows of a band share.
struct Band {
    theta_d: Axis,
    phi_d: Axis,
}

/// A `NodeLattice`, as tables by step of the fine grid.
pub struct Nodes {
    rows: Axis,
    bands: Vec<Band>,
    /// For each step in θ_h the bands of the rows below and after.
    band: [[u8; 2]; 256],
    pub size: usize,
}

impl Nodes {
    /// None where `NodeLattice` would complain: then no step leads outside the nodes.
    pub fn new(theta_h: &[u8], band: &[u8], theta_d: &[Vec<u8>], phi_d: &[Vec<u8>]) -> Option<Nodes> {
        let spans = |axis: &[u8]| increases(axis) && axis.len() > 1 && axis[axis.len() - 1] as usize == FINE;
        let turns = |axis: &[u8]| increases(axis) && (axis[axis.len() - 1] as usize) < FINE;
        if !spans(theta_h)
            || !theta_d.iter().all(|axis| spans(axis))
            || !phi_d.iter().all(|axis| turns(axis))
            || theta_d.len() != phi_d.len()
            || band.len() != theta_h.len()
            || band.iter().any(|&b| b as usize >= theta_d.len())
            || (0..theta_d.len()).any(|b| !band.iter().any(|&other| other as usize == b))
        {
            return None;
        }
        let mut base = vec![0];
        for &b in band {
            base.push(base[base.len() - 1] + (theta_d[b as usize].len() * phi_d[b as usize].len()) as u32);
        }
        let bands = theta_d.iter().zip(phi_d).map(|(theta_d, phi_d)| {
            let count = phi_d.len() as u32;
            let turn: Vec<u8> = phi_d.iter().copied().chain([FINE as u8]).collect();
            Band {
                theta_d: steps(theta_d, |node| node as u32 * count),
                phi_d: steps(&turn, |node| node as u32 % count),
            }
        });
        let band = below(theta_h).map(|row| [band[row], band[row + 1]]);
        let (rows, size) = (steps(theta_h, |row| base[row]), base[base.len() - 1] as usize);
        Some(Nodes { rows, bands: bands.collect(), band, size })
    }

    /// y at a place on the fine grid, in the order of `NodeLattice.corners`.
    #[inline(always)]
    fn blend(&self, [x, y, z]: [f64; 3], step: [u8; 3], value: impl Fn(usize) -> [f64; 4]) -> [f64; 4] {
        let [h, d, p] = step.map(usize::from);
        let row = &self.rows[h];
        let t = row.share(x);
        let mut sum = [0.0; 4];
        for (base, weight, band) in [(row.below, 1.0 - t, self.band[h][0]), (row.after, t, self.band[h][1])] {
            let band = &self.bands[band as usize];
            let (d, p) = (&band.theta_d[d], &band.phi_d[p]);
            let (u, v) = (d.share(y), p.share(z));
            for (line, a) in [(base + d.below, 1.0 - u), (base + d.after, u)] {
                for (node, b) in [(line + p.below, 1.0 - v), (line + p.after, v)] {
                    let (weight, value) = (weight * a * b, value(node as usize));
                    for j in 0..4 {
                        sum[j] += weight * value[j];
                    }
                }
            }
        }
        sum
    }
}

fn increases(axis: &[u8]) -> bool {
    axis.first() == Some(&0) && axis.is_sorted_by(|a, b| a < b)
}

/// For each step the node at or below its start. axis: places that increase from 0 to FINE.
fn below(axis: &[u8]) -> [usize; 256] {
    let mut node = 0;
    std::array::from_fn(|step| {
        node += usize::from(axis[node + 1] as usize <= step.min(FINE - 1));
        node
    })
}

/// number: what a node counts in the lattice.
fn steps(axis: &[u8], number: impl Fn(usize) -> u32) -> Axis {
    below(axis).map(|node| {
        let (place, next) = (f64::from(axis[node]), f64::from(axis[node + 1]));
        Step { below: number(node), after: number(node + 1), place, per_width: 1.0 / (next - place) }
    })
}

/// y of the nodes: the product of a gain and a shape each. NaN where an index leads outside.
pub struct Factors<'a> {
    pub gains: &'a [f64],
    pub shapes: &'a [[f64; 3]],
    pub gain: &'a [u16],
    pub shape: &'a [u16],
}

impl Factors<'_> {
    /// Whether each of so many nodes has a gain and a shape, and all are finite.
    pub fn fit(&self, nodes: usize) -> bool {
        let within = |index: &[u16], count: usize| {
            index.len() == nodes && index.iter().max().is_some_and(|&last| (last as usize) < count)
        };
        within(self.gain, self.gains.len())
            && within(self.shape, self.shapes.len())
            && self.gains.iter().chain(self.shapes.as_flattened()).all(|factor| factor.is_finite())
    }

    #[inline(always)]
    fn value(&self, node: usize) -> [f64; 4] {
        match (entry(self.gains, self.gain, node), entry(self.shapes, self.shape, node)) {
            (Some(gain), Some(shape)) => [gain * shape[0], gain * shape[1], gain * shape[2], 0.0],
            _ => [f64::NAN; 4],
        }
    }
}

#[inline(always)]
fn entry<'a, T>(entries: &'a [T], index: &[u16], node: usize) -> Option<&'a T> {
    index.get(node).and_then(|&number| entries.get(number as usize))
}

/// A material on nodes.
pub struct OnNodes<'a> {
    nodes: &'a Nodes,
    factors: Factors<'a>,
    scale: f64,
    /// The products, as fours that vectors hold; none for few pairs, which take less time than all products.
    values: Vec<[f64; 4]>,
}

impl<'a> OnNodes<'a> {
    pub fn new(nodes: &'a Nodes, factors: Factors<'a>, scale: f64, pairs: usize) -> Self {
        let made = if pairs > nodes.size / 6 { nodes.size } else { 0 };
        let values = (0..made).map(|node| factors.value(node)).collect();
        OnNodes { nodes, factors, scale, values }
    }

    #[inline(always)]
    fn fill(
        &self,
        pairs: &Pairs,
        at: &Room,
        steps: &[[u8; BATCH]; 3],
        out: &mut [f64],
        value: impl Fn(usize) -> [f64; 4],
    ) {
        for i in 0..BATCH.min(out.len() / 3) {
            let f_r = match pairs.told(i) {
                Some(told) => [told; 4],
                None => {
                    let y = self.nodes.blend([0, 1, 2].map(|c| at[c][i]), steps.map(|step| step[i]), &value);
                    y.map(|y| if y > 0.0 { y * y * y * at[3][i] } else { 0.0 })
                }
            };
            match out.get_mut(3 * i..3 * i + 4) {
                Some(four) => four.copy_from_slice(&f_r), // in one piece; the next pair writes over the fourth
                None => out[3 * i..].copy_from_slice(&f_r[..3]),
            }
        }
    }
}

impl Material for OnNodes<'_> {
    #[inline(always)]
    fn batch(&self, pairs: &Pairs, at: &mut Room, out: &mut [[f64; 3]]) {
        let mut steps = [[0; BATCH]; 3];
        for i in 0..BATCH {
            let place = place(pairs.half_diff(i, true));
            for c in 0..3 {
                at[c][i] = place[c];
                steps[c][i] = step(place[c]);
            }
            let [cos_i, cos_o] = pairs.cosines(i).map(|c| c.max(SMALLEST_COSINE));
            at[3][i] = self.scale / (cos_i * cos_o);
        }
        let out = out.as_flattened_mut();
        if self.values.is_empty() {
            self.fill(pairs, at, &steps, out, |node| self.factors.value(node));
        } else {
            self.fill(pairs, at, &steps, out, |node| self.values[node]);
        }
    }
}

/// The step of the fine grid that a place lies in.
#[inline(always)]
fn step(place: f64) -> u8 {
    const LAST: f64 = FINE as f64 - 1.0;
    let place = if place < LAST { place } else { LAST };
    let place = if place > 0.0 { place } else { 0.0 };
    // SAFETY: it is from 0 to LAST, also if it was no number. The safe conversion does not vectorise.
    unsafe { place.to_int_unchecked::<i32>() as u8 }
}

/// The place on the fine grid of half/difference angles.
#[inline(always)]
fn place([theta_h, theta_d, phi_d]: [f64; 3]) -> [f64; 3] {
    use std::f64::consts::{FRAC_PI_2, PI};
    let a = (theta_h * (1.0 / FRAC_PI_2)).sqrt();
    let x = if a < KNEE / BELOW { a * BELOW } else { KNEE + (a - KNEE / BELOW) * ABOVE };
    let z = phi_d * (FINE as f64 / PI);
    [x, theta_d * (FINE as f64 / FRAC_PI_2), if z >= FINE as f64 { z - FINE as f64 } else { z }]
}
