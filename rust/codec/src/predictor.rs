//! Predicts one coordinate of a node from its neighbours by recursive least squares, in the order of operations that
//! docs/format.md gives.

/// A node is predicted from so many neighbours.
const NEIGHBOURS: usize = 10;
/// A number for each neighbour.
pub type Row = [f64; NEIGHBOURS];
/// The weights of the neighbours at first.
const FIRST: Row = [0.5, 0.5, 0.0, 0.0, -0.5, -0.5, 0.0, 0.0, 0.0, 0.0];
/// 1 / the factor by which earlier nodes lose their influence with each new one.
const FORGET: f64 = 1.0005;

/// How much less is open of weights that are known beforehand than of `FIRST`.
const KNOWN: f64 = 0.1;

/// The predictor, and its prediction for the present node.
pub struct Predictor {
    weights: Row,
    /// The inverse of the neighbours' correlation matrix.
    inverse: [Row; NEIGHBOURS],
    /// A running mean of the errors.
    level: f64,
    /// The neighbours of the present node, less the node above it; what they predict; and the error that is expected.
    neighbours: Row,
    predicted: f64,
    scale: f64,
}

impl Predictor {
    /// values: the coordinate's in all entries of the palette.
    pub fn new(values: &[f64]) -> Self {
        let count = values.len() as f64;
        let mean = values.iter().sum::<f64>() / count;
        let variance = values.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / count + 1e-4;
        let mut inverse = [[0.0; NEIGHBOURS]; NEIGHBOURS];
        for (i, row) in inverse.iter_mut().enumerate() {
            row[i] = 25.0 / variance;
        }
        let level = 0.15 * variance.sqrt();
        Predictor { weights: FIRST, inverse, level, neighbours: [0.0; NEIGHBOURS], predicted: 0.0, scale: level }
    }

    /// One that begins with weights and a mean error that others have learnt.
    pub fn after(values: &[f64], weights: Row, level: f64) -> Self {
        let mut made = Predictor { weights, level, scale: level, ..Predictor::new(values) };
        made.inverse.iter_mut().flatten().for_each(|x| *x *= KNOWN);
        made
    }

    /// The weights of the neighbours, and the running mean of the errors.
    pub fn learnt(&self) -> (Row, f64) {
        (self.weights, self.level)
    }

    /// Predicts a node. up: the value above it, which is subtracted from the neighbours' values. errors: of the predictions of
    /// the nodes next to it, as far as there are any.
    #[inline(always)]
    pub fn predict(&mut self, up: f64, values: Row, errors: &[Option<f64>]) {
        self.predicted = up;
        for (i, value) in values.into_iter().enumerate() {
            self.neighbours[i] = value - up;
            self.predicted += self.weights[i] * self.neighbours[i];
        }
        let (mut sum, mut count) = (0.7 * self.level, 0.7);
        for error in errors.iter().flatten() {
            sum += error;
            count += 1.0;
        }
        self.scale = sum / count + 0.02 * self.level + 1e-4;
    }

    /// The prediction, and 1 / the expected error.
    #[inline(always)]
    pub fn expected(&self) -> (f64, f64) {
        (self.predicted, 1.0 / self.scale)
    }

    /// Adapts to the node's value. Returns how far the prediction was off.
    #[inline(always)]
    pub fn learn(&mut self, value: f64) -> f64 {
        let error = value - self.predicted;
        let mut gain = [0.0; NEIGHBOURS];
        for (row, x) in self.inverse.iter().zip(self.neighbours) {
            for (g, entry) in gain.iter_mut().zip(row) {
                *g += entry * x;
            }
        }
        let mut power = 1.0;
        for (g, x) in gain.iter().zip(self.neighbours) {
            power += g * x;
        }
        let inverse_power = 1.0 / power;
        for i in 0..NEIGHBOURS {
            self.weights[i] += gain[i] * inverse_power * error;
            for j in 0..NEIGHBOURS {
                self.inverse[i][j] = (self.inverse[i][j] - gain[i] * gain[j] * inverse_power) * FORGET;
            }
        }
        self.level = 0.98 * self.level + 0.02 * error.abs();
        error.abs()
    }
}
