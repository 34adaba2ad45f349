//! How likely each entry of the palette is for the next node, given the nodes before it: the same calculation when entries are
//! chosen, written and read. Nothing but +, −, ×, ÷, √ and ⌊⌋ of IEEE 754 doubles, in the order written: all machines agree.

use super::entries::{Entries, Expected};
use super::predictor::Predictor;
use super::range::Coder;
use super::{Axes, FINE, Palette};

/// A node's coordinates: octaves of the gain, and the two of the shape.
pub const CHANNELS: usize = 3;
type Node = [f64; CHANNELS];

/// Nodes on the grid (θ_d, φ_d) of a band.
#[derive(Default)]
struct Plane {
    values: Vec<Node>,
    errors: Vec<Node>,
}

pub struct Model<'a> {
    axes: &'a Axes,
    predictors: [Predictor; CHANNELS],
    gains: Entries,
    shapes: Entries,
    row: usize,
    present: Plane,
    above: Plane,
    higher: Plane,
}

impl<'a> Model<'a> {
    pub fn new(axes: &'a Axes, palette: &Palette) -> Self {
        let [gains, first, second] = palette.places();
        let flat = vec![0.0; gains.len()];
        Model {
            axes,
            predictors: [&gains, &first, &second].map(|places| Predictor::new(places)),
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
            let (from, to) = (self.axes.band[row - 1] as usize, self.axes.band[row] as usize);
            if from != to {
                self.above = self.moved(&self.above, from, to);
                self.higher = if row > 1 { self.moved(&self.higher, from, to) } else { Plane::default() };
            }
        }
        let size = self.axes.nodes_in(row);
        self.present = Plane { values: vec![[0.0; CHANNELS]; size], errors: vec![[0.0; CHANNELS]; size] };
    }

    /// A plane on another band's nodes, by bilinear interpolation.
    fn moved(&self, plane: &Plane, from: usize, to: usize) -> Plane {
        let width = self.axes.phi_d[from].len();
        let mut moved = Plane::default();
        for &y in &self.axes.theta_d[to] {
            let (d0, d1, v) = between(&self.axes.theta_d[from], y);
            for &x in &self.axes.phi_d[to] {
                let (p0, p1, u) = around(&self.axes.phi_d[from], x);
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

    /// Before a node: what its coordinates are likely to be. d, p: its numbers in θ_d and φ_d.
    #[inline(always)]
    pub fn expect(&mut self, d: usize, p: usize) {
        let band = self.axes.band[self.row] as usize;
        let phi_d = &self.axes.phi_d[band];
        let (width, height) = (phi_d.len(), self.axes.theta_d[band].len());
        let (at, under) = (d * width + p, self.row > 0);
        let [west, east] = [(p + width - 1) % width, (p + 1) % width].map(|q| d * width + q);
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

    /// The weights of all gains for the node that is expected.
    #[inline(always)]
    pub fn gain_weights(&mut self) -> &[u32] {
        let expected = self.gain_expected();
        self.gains.weigh(&expected);
        &self.gains.weights
    }

    /// The weights of all shapes.
    #[inline(always)]
    pub fn shape_weights(&mut self) -> &[u32] {
        let expected = self.shape_expected();
        self.shapes.weigh(&expected);
        &self.shapes.weights
    }

    /// Entries of both palettes within reach, added up over all nodes so far.
    #[inline(always)]
    pub fn reached(&self) -> usize {
        self.gains.reached + self.shapes.reached
    }

    /// A gain has one coordinate; the other never differs.
    #[inline(always)]
    fn gain_expected(&self) -> Expected {
        [self.predictors[0].expected(), (0.0, 0.0)]
    }

    #[inline(always)]
    fn shape_expected(&self) -> Expected {
        [self.predictors[1].expected(), self.predictors[2].expected()]
    }

    /// Writes or reads the entries of the node that is expected.
    #[inline(always)]
    pub fn node(&mut self, coder: &mut impl Coder, at: usize, gain: usize, shape: usize) -> (usize, usize) {
        let gain = coder.pick(gain, self.gain_weights());
        let shape = coder.pick(shape, self.shape_weights());
        self.update(at, gain, shape);
        (gain, shape)
    }

    /// What follows for the nodes to come. at: the node's number in its row.
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

/// The nodes on either side of a place within the axis, and the way to the second.
fn between(axis: &[u8], place: u8) -> (usize, usize, f64) {
    let upper = axis.partition_point(|&x| x <= place);
    if upper == axis.len() {
        return (upper - 1, upper - 1, 0.0);
    }
    let (a, b) = (axis[upper - 1], axis[upper]);
    (upper - 1, upper, f64::from(place - a) / f64::from(b - a))
}

/// The same on an axis that starts at 0 and returns there at FINE.
fn around(axis: &[u8], place: u8) -> (usize, usize, f64) {
    let last = axis.len() - 1;
    if place < axis[last] {
        return between(axis, place);
    }
    (last, 0, f64::from(place - axis[last]) / f64::from(FINE - axis[last]))
}
