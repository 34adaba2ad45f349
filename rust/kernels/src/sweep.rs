//! Chooses the gain and the shape of each node, one node after the other: those that cost the least in error and bits, given
//! what the other nodes have at that time.

use sommerl_codec::{Model, NodeLattice, Palette, Prior, Weights, bits_of};

use crate::least_squares::Normal;

/// What the codes of a palette stand for.
pub struct Values<'a> {
    /// One for each gain.
    pub gains: &'a [f64],
    /// One for each shape.
    pub shapes: &'a [[f64; 3]],
}

/// How often gain and shape are chosen in turn. More changes nothing.
const TURNS: usize = 3;

/// One sweep over all nodes in the order of the stream. Returns the bits of the indices. prior: what the model begins with. equations: half the error of values z is
/// zᵀHz/2 − bᵀz for each channel. price: the error that a bit is worth; if
/// None, no node changes. Panics if sizes do not fit.
#[allow(clippy::too_many_arguments)] // what is swept, by what, towards what
pub fn sweep(
    lattice: &NodeLattice,
    palette: &Palette,
    prior: Option<&Prior>,
    values: &Values,
    equations: &Normal,
    gain: &mut [u16],
    shape: &mut [u16],
    price: Option<f64>,
) -> f64 {
    let Values { gains, shapes } = *values;
    let value = |g: u16, s: u16| shapes[s as usize].map(|x| gains[g as usize] * x);
    let mut z: Vec<[f64; 3]> = gain.iter().zip(shape.iter()).map(|(&g, &s)| value(g, s)).collect();
    let mut model = Model::new(lattice, palette, prior);
    let (mut gain_bits, mut shape_bits) = (vec![0.0; gains.len()], vec![0.0; shapes.len()]);
    let (mut i, mut bits) = (0, 0.0);
    for row in 0..lattice.band.len() {
        model.begin(row);
        let width = lattice.width(row);
        for at in 0..lattice.nodes_in(row) {
            model.expect(at / width, at % width);
            costs(model.gain_weights(), &mut gain_bits);
            costs(model.shape_weights(), &mut shape_bits);
            let (mut g, mut s) = (gain[i] as usize, shape[i] as usize);
            if let Some(price) = price {
                let (target, weight) = equations.wanted(i, &z);
                let choice = Choice { gains, shapes, gain_bits: &gain_bits, shape_bits: &shape_bits, price };
                (g, s) = choice.best(target, weight, (g, s));
                (gain[i], shape[i]) = (g as u16, s as u16);
                z[i] = value(gain[i], shape[i]);
            }
            bits += gain_bits[g] + shape_bits[s];
            model.update(at, g, s);
            i += 1;
        }
    }
    bits
}

impl Normal {
    /// The value of node i at which the error is least if the other nodes stay; and half the error's second derivative there.
    fn wanted(&self, i: usize, z: &[[f64; 3]]) -> ([f64; 3], f64) {
        let (mut target, mut weight) = (self.right[i], 1e-30);
        for (j, h) in self.row(i) {
            if j == i {
                weight = h;
            } else {
                for c in 0..3 {
                    target[c] -= h * z[j][c];
                }
            }
        }
        (target.map(|x| x / weight), weight)
    }
}

struct Choice<'a> {
    gains: &'a [f64],
    shapes: &'a [[f64; 3]],
    gain_bits: &'a [f64],
    shape_bits: &'a [f64],
    price: f64,
}

impl Choice<'_> {
    fn best(&self, target: [f64; 3], weight: f64, now: (usize, usize)) -> (usize, usize) {
        let likely = least(self.shape_bits.iter().copied()).0;
        let starts = [now, (now.0, likely)];
        let found = starts.map(|(gain, shape)| self.from(target, weight, gain, shape));
        let better = usize::from(found[1].1 < found[0].1);
        found[better].0
    }

    /// The best gain for a shape, the best shape for that gain, and so on.
    fn from(&self, target: [f64; 3], weight: f64, mut gain: usize, mut shape: usize) -> ((usize, usize), f64) {
        let mut cost = f64::INFINITY;
        for _ in 0..TURNS {
            let error = |g: f64, s: [f64; 3]| {
                let d = [g * s[0] - target[0], g * s[1] - target[1], g * s[2] - target[2]];
                weight * (d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
            };
            let s = self.shapes[shape];
            gain = least(self.gains.iter().zip(self.gain_bits).map(|(&g, bits)| error(g, s) + self.price * bits)).0;
            let g = self.gains[gain];
            let (best, at_best) =
                least(self.shapes.iter().zip(self.shape_bits).map(|(&s, bits)| error(g, s) + self.price * bits));
            shape = best;
            let total = at_best + self.price * self.gain_bits[gain];
            if total >= cost {
                break;
            }
            cost = total;
        }
        ((gain, shape), cost)
    }
}

fn least(values: impl Iterator<Item = f64>) -> (usize, f64) {
    values.enumerate().fold((0, f64::INFINITY), |best, (i, x)| if x < best.1 { (i, x) } else { best })
}

/// The bits that each entry would take.
fn costs(weights: Weights<'_>, bits: &mut [f64]) {
    let of_1 = bits_of(1, weights.total); // most weights are 1, and logarithms take long
    for (bits, &weight) in bits.iter_mut().zip(weights.each) {
        *bits = if weight == 1 { of_1 } else { bits_of(weight, weights.total) };
    }
}
