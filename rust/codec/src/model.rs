//! How likely each entry of the palette is for the next node, given the nodes before it: the same calculation when entries are
//! chosen, written and read. It uses +, −, ×, ÷, √ and ⌊⌋ of IEEE 754 doubles alone, in the order written, so that all machines
//! get the same bits.

use crate::entries::{Entries, Expected};
use crate::lattice::{FINE, NodeLattice};
use crate::palette::Palette;
use crate::predictor::{Predictor, Row};
use crate::range_coder::Weights;

/// A node's coordinates: octaves of the gain, and the two of the shape.
const CHANNELS: usize = 3;
type Node = [f64; CHANNELS];

/// What the predictors of the three coordinates begin with, instead of knowing nothing: what they learnt from other materials.
#[derive(Clone, Debug, PartialEq)]
pub struct Prior {
    /// The weights of a node's neighbours.
    pub weights: [Row; CHANNELS],
    /// The usual errors, above 0.
    pub levels: Node,
}

/// The nodes of a row, or a row's nodes moved to the places of another band.
#[derive(Default)]
struct Plane {
    values: Vec<Node>,
    /// How far each prediction was off.
    errors: Vec<Node>,
}

/// The model of the entries. For each row call `begin`; then for each node `expect`, the weights, and `update`, in this order.
pub struct Model<'a> {
    lattice: &'a NodeLattice,
    predictors: [Predictor; CHANNELS],
    gains: Entries,
    shapes: Entries,
    row: usize,
    /// The present row, the one before it, and the one before that.
    present: Plane,
    above: Plane,
    higher: Plane,
}

impl<'a> Model<'a> {
    /// Before the first row.
    pub fn new(lattice: &'a NodeLattice, palette: &Palette, prior: Option<&Prior>) -> Self {
        let [gains, first, second] = palette.places();
        let flat = vec![0.0; gains.len()];
        let places = [&gains, &first, &second];
        let predictors = std::array::from_fn(|c| match prior {
            Some(known) => Predictor::after(places[c], known.weights[c], known.levels[c]),
            None => Predictor::new(places[c]),
        });
        Model {
            lattice,
            predictors,
            gains: Entries::new([gains, flat]),
            shapes: Entries::new([first, second]),
            row: 0,
            present: Plane::default(),
            above: Plane::default(),
            higher: Plane::default(),
        }
    }

    /// Before the first node of a row.
    pub fn begin(&mut self, row: usize) {
        self.row = row;
        if row > 0 {
            self.higher = std::mem::take(&mut self.above);
            self.above = std::mem::take(&mut self.present);
            let (from, to) = (self.lattice.band[row - 1] as usize, self.lattice.band[row] as usize);
            if from != to {
                self.above = self.moved(&self.above, from, to);
                self.higher = if row > 1 { self.moved(&self.higher, from, to) } else { Plane::default() };
            }
        }
        let size = self.lattice.nodes_in(row);
        self.present = Plane { values: vec![[0.0; CHANNELS]; size], errors: vec![[0.0; CHANNELS]; size] };
    }

    /// A plane at the places of another band, by bilinear interpolation.
    fn moved(&self, plane: &Plane, from: usize, to: usize) -> Plane {
        let width = self.lattice.phi_d[from].len();
        let way = if self.lattice.mirrored { between } else { around };
        let mut moved = Plane::default();
        for &y in &self.lattice.theta_d[to] {
            let (d0, d1, v) = between(&self.lattice.theta_d[from], y);
            for &x in &self.lattice.phi_d[to] {
                let (p0, p1, u) = way(&self.lattice.phi_d[from], x);
                let blend = |values: &[Node], c: usize| {
                    let low = values[d0 * width + p0][c] * (1.0 - u) + values[d0 * width + p1][c] * u;
                    let high = values[d1 * width + p0][c] * (1.0 - u) + values[d1 * width + p1][c] * u;
                    low * (1.0 - v) + high * v
                };
                moved.values.push(std::array::from_fn(|c| blend(&plane.values, c)));
                moved.errors.push(std::array::from_fn(|c| blend(&plane.errors, c)));
            }
        }
        moved
    }

    /// Before a node: predicts its coordinates. d, p: its numbers in θ_d and φ_d.
    #[inline(always)]
    pub fn expect(&mut self, d: usize, p: usize) {
        let band = self.lattice.band[self.row] as usize;
        let phi_d = &self.lattice.phi_d[band];
        let (width, height) = (phi_d.len(), self.lattice.theta_d[band].len());
        let (at, under) = (d * width + p, self.row > 0);
        let [west, east] = beside(p, width, self.lattice.mirrored).map(|q| d * width + q);
        let mirror = (p > 0).then(|| FINE - phi_d[p]).filter(|&m| m <= phi_d[p - 1]);
        let mirror = mirror.map(|m| between(&phi_d[..p], m));
        let (now, above, higher) = (&self.present.values, &self.above.values, &self.higher.values);
        for c in 0..CHANNELS {
            let left = (p > 0).then(|| now[at - 1][c]);
            let north = |i: usize| (d > 0).then(|| now[i - width][c]);
            let up = if under {
                above[at][c]
            } else {
                match (left, north(at)) {
                    (Some(x), Some(y)) => 0.5 * (x + y),
                    (x, y) => x.or(y).unwrap_or(0.0),
                }
            };
            let over = |there: bool, i: usize| if under && there { above[i][c] } else { up };
            let reflected = |plane: &[Node]| {
                mirror.map(|(q0, q1, u)| plane[d * width + q0][c] * (1.0 - u) + plane[d * width + q1][c] * u)
            };
            let news = reflected(now).map(|value| value - if under { reflected(above).unwrap_or(up) } else { up });
            let values = [
                left.unwrap_or(over(true, west)),
                north(at).unwrap_or(up),
                north(west).unwrap_or(up),
                north(east).unwrap_or(up),
                over(true, west),
                over(d > 0, at.wrapping_sub(width)),
                over(true, east),
                over(d + 1 < height, at + width),
                if self.row > 1 { higher[at][c] } else { up },
                up + news.unwrap_or(0.0),
            ];
            let errors = [
                (p > 0).then(|| self.present.errors[at - 1][c]),
                (d > 0).then(|| self.present.errors[at - width][c]),
                under.then(|| self.above.errors[at][c]),
            ];
            self.predictors[c].predict(up, values, &errors);
        }
    }

    /// The weights of all gains for the node of `expect`.
    #[inline(always)]
    pub fn gain_weights(&mut self) -> Weights<'_> {
        let expected = self.gain_expected();
        self.gains.weigh(&expected)
    }

    /// The weights of all shapes for the node of `expect`.
    #[inline(always)]
    pub fn shape_weights(&mut self) -> Weights<'_> {
        let expected = self.shape_expected();
        self.shapes.weigh(&expected)
    }

    /// The number of gains and shapes whose weights were calculated and not taken as 1, added up over all nodes so far.
    #[inline(always)]
    pub fn reached(&self) -> usize {
        self.gains.reached + self.shapes.reached
    }

    /// What the predictors have learnt so far.
    pub fn learnt(&self) -> Prior {
        let learnt = self.predictors.each_ref().map(Predictor::learnt);
        Prior { weights: learnt.map(|(weights, _)| weights), levels: learnt.map(|(_, level)| level) }
    }

    /// Gains have one coordinate: the second is 0 and is given no weight.
    #[inline(always)]
    fn gain_expected(&self) -> Expected {
        [self.predictors[0].expected(), (0.0, 0.0)]
    }

    #[inline(always)]
    fn shape_expected(&self) -> Expected {
        [self.predictors[1].expected(), self.predictors[2].expected()]
    }

    /// After a node: adapts to the entries that it has. at: its number in its row.
    #[inline(always)]
    pub fn update(&mut self, at: usize, gain: usize, shape: usize) {
        let (gain_expected, shape_expected) = (self.gain_expected(), self.shape_expected());
        self.gains.learn(gain, &gain_expected);
        self.shapes.learn(shape, &shape_expected);
        let values = [self.gains.places[0][gain], self.shapes.places[0][shape], self.shapes.places[1][shape]];
        self.present.values[at] = values;
        for (c, value) in values.into_iter().enumerate() {
            self.present.errors[at][c] = self.predictors[c].learn(value);
        }
    }
}

/// The nodes next to node p in φ_d, which turns, or turns back at its ends if the lattice is mirrored.
#[inline(always)]
fn beside(p: usize, width: usize, mirrored: bool) -> [usize; 2] {
    let last = width - 1;
    if mirrored {
        [if p > 0 { p - 1 } else { last.min(1) }, if p < last { p + 1 } else { last.saturating_sub(1) }]
    } else {
        [(p + last) % width, (p + 1) % width]
    }
}

/// The nodes on either side of a place, and how far it lies from the first to the second, from 0 to 1. At or after the last node,
/// both are the last.
fn between(axis: &[u8], place: u8) -> (usize, usize, f64) {
    let upper = axis.partition_point(|&x| x <= place);
    if upper == axis.len() {
        return (upper - 1, upper - 1, 0.0);
    }
    let (a, b) = (axis[upper - 1], axis[upper]);
    (upper - 1, upper, f64::from(place - a) / f64::from(b - a))
}

/// The same on an axis whose first node, at 0, comes again at FINE.
fn around(axis: &[u8], place: u8) -> (usize, usize, f64) {
    let last = axis.len() - 1;
    if place < axis[last] {
        return between(axis, place);
    }
    (last, 0, f64::from(place - axis[last]) / f64::from(FINE - axis[last]))
}
