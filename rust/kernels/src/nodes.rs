//! Lookup in a compact material: the same formulas, in the same order, as `reflectance/nodes.py`, but for divisions by the distances
//! between nodes, which are done beforehand.

use sommerl_codec::NodeLattice;

use crate::lookup::{BATCH, Material, Pairs, Room, half_diff};

/// The constants of `reflectance/nodes.py`.
const FINE: usize = sommerl_codec::FINE as usize;
const KNEE: f64 = 90.0;
const BELOW: f64 = 360.0;
const ABOVE: f64 = 120.0;
const SMALLEST_COSINE: f64 = 0.01;
const HORIZON: f64 = 0.0009;

/// The two nodes of an axis that a step of the fine grid lies between.
#[derive(Clone, Copy)]
struct Step {
    /// How far the number of the node below, and of the one after, is from the number of the axis' first node.
    below: u32,
    after: u32,
    /// The place of the node below, and 1 / the distance to the one after.
    place: f64,
    per_width: f64,
}

impl Step {
    /// How far a place lies from the node below to the one after, from 0 to 1.
    #[inline(always)]
    fn share(&self, x: f64) -> f64 {
        ((x - self.place) * self.per_width).clamp(0.0, 1.0)
    }
}

/// A step for every byte, so that no check is needed: those beyond the fine grid are like its last one.
type Axis = [Step; 256];

/// The axes of a band.
struct Band {
    theta_d: Axis,
    phi_d: Axis,
}

/// Nodes, and the shares of each in a value.
pub type Corners = [(u32, f64); 8];

/// A lattice of nodes, prepared for lookup: tables of the steps of the fine grid.
pub struct NodeSteps {
    rows: Axis,
    bands: Vec<Band>,
    /// For each step in θ_h the bands of the rows below and after.
    band: [[u8; 2]; 256],
    nodes: usize,
    theta_h: Vec<u8>,
    reciprocal: bool,
    mirrored: bool,
}

impl NodeSteps {
    /// None if the lattice is not valid.
    pub fn new(lattice: &NodeLattice) -> Option<NodeSteps> {
        if !lattice.is_valid() {
            return None;
        }
        let &NodeLattice { ref theta_h, ref band, ref theta_d, ref phi_d, reciprocal, mirrored } = lattice;
        let mut base = vec![0];
        for &b in band {
            base.push(base[base.len() - 1] + (theta_d[b as usize].len() * phi_d[b as usize].len()) as u32);
        }
        let bands = theta_d.iter().zip(phi_d).map(|(theta_d, phi_d)| {
            let count = phi_d.len() as u32;
            let theta_d = steps(theta_d, |node| node as u32 * count);
            let ends = phi_d[phi_d.len() - 1] == FINE as u8;
            // Else the first node comes again there; also where it is the only one of an axis that does not turn.
            let whole: Vec<u8> = phi_d.iter().copied().chain((!ends).then_some(FINE as u8)).collect();
            Band { theta_d, phi_d: steps(&whole, |node| node as u32 % count) }
        });
        let band = below(theta_h).map(|row| [band[row], band[row + 1]]);
        let rows = steps(theta_h, |row| base[row]);
        Some(NodeSteps {
            rows,
            bands: bands.collect(),
            band,
            nodes: lattice.nodes(),
            theta_h: theta_h.clone(),
            reciprocal,
            mirrored,
        })
    }

    /// The number of nodes.
    pub fn nodes(&self) -> usize {
        self.nodes
    }

    /// Where each row lies on the fine grid.
    pub fn theta_h(&self) -> &[u8] {
        &self.theta_h
    }

    /// The step of the fine grid that a place lies in, and the nodes about it with their shares, in the order of
    /// `NodeLattice.corners`.
    pub fn corners(&self, place: [f64; 3]) -> ([u8; 3], Corners) {
        let step = place.map(step);
        (step, self.corners_in(place, step))
    }

    #[inline(always)]
    fn corners_in(&self, [x, y, z]: [f64; 3], step: [u8; 3]) -> Corners {
        let [h, d, p] = step.map(usize::from);
        let row = &self.rows[h];
        let t = row.share(x);
        let of_row = |base: u32, weight: f64, band: u8| {
            let band = &self.bands[band as usize];
            let (d, p) = (&band.theta_d[d], &band.phi_d[p]);
            let (u, v) = (d.share(y), p.share(z));
            let of_line = |line: u32, weight: f64| [(line + p.below, weight * (1.0 - v)), (line + p.after, weight * v)];
            [of_line(base + d.below, weight * (1.0 - u)), of_line(base + d.after, weight * u)]
        };
        let [below, after] = [of_row(row.below, 1.0 - t, self.band[h][0]), of_row(row.after, t, self.band[h][1])];
        [below[0][0], below[0][1], below[1][0], below[1][1], after[0][0], after[0][1], after[1][0], after[1][1]]
    }

    /// f_r of one pair, whose components are finite and which is above the horizon. value: of each node.
    pub fn eval(&self, wi: [f64; 3], wo: [f64; 3], cubes: Cubes, value: impl Fn(usize) -> [f64; 4]) -> [f64; 3] {
        let at = match (self.reciprocal, self.mirrored) {
            (false, false) => place::<false, false>(wi, wo),
            (false, true) => place::<false, true>(wi, wo),
            (true, false) => place::<true, false>(wi, wo),
            (true, true) => place::<true, true>(wi, wo),
        };
        let [r, g, b, _] = cubes.of(self.blend(at, at.map(step), value), cubes.factor(wi[2], wo[2]));
        [r, g, b]
    }

    /// The value at a place on the fine grid. step: that it lies in.
    #[inline(always)]
    fn blend(&self, place: [f64; 3], step: [u8; 3], value: impl Fn(usize) -> [f64; 4]) -> [f64; 4] {
        let mut sum = [0.0; 4];
        for (node, weight) in self.corners_in(place, step) {
            let value = value(node as usize);
            for j in 0..4 {
                sum[j] += weight * value[j];
            }
        }
        sum
    }
}

/// For each step, the number on its axis of the last node at or below its start, which is never the axis' last. axis: places
/// that increase from 0 to FINE.
fn below(axis: &[u8]) -> [usize; 256] {
    let mut node = 0;
    std::array::from_fn(|step| {
        node += usize::from(axis[node + 1] as usize <= step.min(FINE - 1));
        node
    })
}

/// number: of a node on this axis, how far its number in the lattice is from that of the axis' first node.
fn steps(axis: &[u8], number: impl Fn(usize) -> u32) -> Axis {
    below(axis).map(|node| {
        let (place, next) = (f64::from(axis[node]), f64::from(axis[node + 1]));
        Step { below: number(node), after: number(node + 1), place, per_width: 1.0 / (next - place) }
    })
}

/// The values of nodes, in the cube-root domain: a gain times a shape each. NaN where an index leads outside.
#[derive(Clone, Copy)]
pub struct Factors<'a> {
    /// What nodes' gains are chosen from.
    pub gains: &'a [f64],
    /// What nodes' shapes are chosen from.
    pub shapes: &'a [[f64; 3]],
    /// The number of each node's gain.
    pub gain: &'a [u16],
    /// The number of each node's shape.
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

    /// The value of a node, as four numbers for vectors to hold; the last means nothing.
    #[inline(always)]
    pub fn value(&self, node: usize) -> [f64; 4] {
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

/// How blended values become f_r: they are cubed, and divided by cosines.
#[derive(Clone, Copy)]
pub struct Cubes {
    scale: f64,
    /// Blended values up to this one count as 0.
    least: f64,
    /// Whether the cosines that cubes are divided by end smoothly.
    smooth: bool,
}

impl Cubes {
    /// scale: of the cube-root domain. signed: whether blended values below 0 count, and not as 0. smooth: whether the cosines
    /// that their cubes are divided by end smoothly.
    pub fn new(scale: f64, signed: bool, smooth: bool) -> Self {
        Cubes { scale, least: if signed { f64::NEG_INFINITY } else { 0.0 }, smooth }
    }

    /// What cubes are multiplied with.
    #[inline(always)]
    fn factor(&self, cos_i: f64, cos_o: f64) -> f64 {
        let damped = if self.smooth {
            ((cos_i * cos_i + HORIZON) * (cos_o * cos_o + HORIZON)).sqrt()
        } else {
            cos_i.max(SMALLEST_COSINE) * cos_o.max(SMALLEST_COSINE)
        };
        self.scale / damped
    }

    #[inline(always)]
    fn of(&self, blended: [f64; 4], factor: f64) -> [f64; 4] {
        blended.map(|y| if y > self.least { y * y * y * factor } else { 0.0 })
    }
}

/// A compact material.
pub struct NodeMaterial<'a> {
    steps: &'a NodeSteps,
    factors: Factors<'a>,
    cubes: Cubes,
    /// The values of all nodes. Empty for few pairs, whose lookup takes less time than to calculate these.
    values: Vec<[f64; 4]>,
}

impl<'a> NodeMaterial<'a> {
    /// pairs: how many it will be evaluated for.
    pub fn new(steps: &'a NodeSteps, factors: Factors<'a>, cubes: Cubes, pairs: usize) -> Self {
        let count = if pairs > steps.nodes / 6 { steps.nodes } else { 0 };
        let values = (0..count).map(|node| factors.value(node)).collect();
        NodeMaterial { steps, factors, cubes, values }
    }

    /// Places of a batch on the fine grid, the steps that they lie in, and what cubes are multiplied with.
    #[inline(always)]
    fn places<const RECIPROCAL: bool, const MIRRORED: bool>(
        &self,
        pairs: &Pairs,
        at: &mut Room,
        steps: &mut [[u8; BATCH]; 3],
    ) {
        for i in 0..BATCH {
            let (wi, wo) = pairs.directions(i);
            let place = place::<RECIPROCAL, MIRRORED>(wi, wo);
            for c in 0..3 {
                at[c][i] = place[c];
                steps[c][i] = step(place[c]);
            }
            at[3][i] = self.cubes.factor(wi[2], wo[2]);
        }
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
        let cubes = self.cubes;
        for i in 0..BATCH.min(out.len() / 3) {
            let f_r = match pairs.known(i) {
                Some(known) => [known; 4],
                None => {
                    let y = self.steps.blend([0, 1, 2].map(|c| at[c][i]), steps.map(|step| step[i]), &value);
                    cubes.of(y, at[3][i])
                }
            };
            match out.get_mut(3 * i..3 * i + 4) {
                Some(four) => four.copy_from_slice(&f_r), // in one piece; the next pair writes over the fourth
                None => out[3 * i..].copy_from_slice(&f_r[..3]),
            }
        }
    }
}

impl Material for NodeMaterial<'_> {
    #[inline(always)]
    fn batch(&self, pairs: &Pairs, at: &mut Room, out: &mut [[f64; 3]]) {
        let mut steps = [[0; BATCH]; 3];
        match (self.steps.reciprocal, self.steps.mirrored) {
            (false, false) => self.places::<false, false>(pairs, at, &mut steps),
            (false, true) => self.places::<false, true>(pairs, at, &mut steps),
            (true, false) => self.places::<true, false>(pairs, at, &mut steps),
            (true, true) => self.places::<true, true>(pairs, at, &mut steps),
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
    // SAFETY: it is from 0 to LAST, even if it was NaN. The safe conversion does not vectorise.
    unsafe { place.to_int_unchecked::<i32>() as u8 }
}

/// The place of a pair on the fine grid.
#[inline(always)]
fn place<const RECIPROCAL: bool, const MIRRORED: bool>(wi: [f64; 3], wo: [f64; 3]) -> [f64; 3] {
    let [theta_h, theta_d, phi_d] = half_diff(wi, wo, RECIPROCAL, MIRRORED);
    use std::f64::consts::{FRAC_PI_2, TAU};
    let range = TAU / if RECIPROCAL { 2.0 } else { 1.0 } / if MIRRORED { 2.0 } else { 1.0 };
    let a = (theta_h * (1.0 / FRAC_PI_2)).sqrt();
    let x = if a < KNEE / BELOW { a * BELOW } else { KNEE + (a - KNEE / BELOW) * ABOVE };
    let z = phi_d * (FINE as f64 / range);
    [x, theta_d * (FINE as f64 / FRAC_PI_2), if !MIRRORED && z >= FINE as f64 { z - FINE as f64 } else { z }]
}
