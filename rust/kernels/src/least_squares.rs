//! The least-squares fit of a lattice's nodes to samples of a material: its normal equations, one channel like another.

use std::collections::HashMap;

use crate::nodes::{Corners, NodeSteps};
use crate::threads::share_out;

/// Corners of a cell, and pairs of them.
const CORNERS: usize = 8;
const PAIRS: usize = CORNERS * (CORNERS + 1) / 2;

/// The equations H z = b of each channel: H sparse and symmetric, by rows.
#[derive(Clone)]
pub struct Normal {
    /// Where each row of H starts in `columns` and `values`, and where the last one ends.
    pub starts: Vec<i32>,
    /// The columns of H's numbers, increasing in each row.
    pub columns: Vec<i32>,
    /// H's numbers.
    pub values: Vec<f64>,
    /// b.
    pub right: Vec<[f64; 3]>,
    /// The weighted sum of the targets' squares: zᵀ H z − 2 bᵀ z + this is the error of z.
    pub squares: f64,
}

/// Samples of a material on the fine grid.
pub struct Samples<'a> {
    /// Places (θ_h, θ_d, φ_d) in steps; θ_h increases.
    pub places: &'a [[f64; 3]],
    /// What each counts.
    pub weights: &'a [f64],
    /// The values there.
    pub targets: &'a [[f64; 3]],
}

/// What the samples in a cell add up to: for each two of its corners the weighted product of their shares, and for each corner
/// that of its share and the targets.
#[derive(Clone)]
struct Cell {
    nodes: [u32; CORNERS],
    products: [f64; PAIRS],
    right: [[f64; 3]; CORNERS],
}

impl Cell {
    fn new(corners: &Corners) -> Cell {
        Cell { nodes: corners.map(|(node, _)| node), products: [0.0; PAIRS], right: [[0.0; 3]; CORNERS] }
    }

    #[inline(always)]
    fn add(&mut self, corners: &Corners, weight: f64, target: [f64; 3]) {
        let mut pair = 0;
        for i in 0..CORNERS {
            let share = weight * corners[i].1;
            for (_, other) in &corners[i..] {
                self.products[pair] += share * other;
                pair += 1;
            }
            for (sum, x) in self.right[i].iter_mut().zip(target) {
                *sum += share * x;
            }
        }
    }
}

/// The cells between two rows, by the steps of their θ_d and φ_d.
struct Layer {
    cells: Vec<Cell>,
    squares: f64,
}

impl Layer {
    /// samples: those between the rows.
    fn of(steps: &NodeSteps, samples: Samples) -> Layer {
        let (mut cells, mut known): (Vec<Cell>, HashMap<(u32, u32), u32>) = Default::default();
        let (mut numbers, mut squares) = (vec![u32::MAX; 1 << 16], 0.0);
        for ((place, &weight), target) in samples.places.iter().zip(samples.weights).zip(samples.targets) {
            let ([_, d, p], corners) = steps.corners(*place);
            // Steps with the same nodes have the same cell; each step finds it once.
            let number = &mut numbers[usize::from(d) << 8 | usize::from(p)];
            if *number == u32::MAX {
                // The first nodes of both rows tell cells apart.
                *number = *known.entry((corners[0].0, corners[4].0)).or_insert_with(|| {
                    cells.push(Cell::new(&corners));
                    cells.len() as u32 - 1
                });
            }
            cells[*number as usize].add(&corners, weight, *target);
            squares += weight * (target[0] * target[0] + target[1] * target[1] + target[2] * target[2]);
        }
        Layer { cells, squares }
    }
}

impl Normal {
    /// The equations of a lattice and samples. Panics if sizes do not fit or θ_h does not increase.
    pub fn of(steps: &NodeSteps, samples: &Samples, threads: usize) -> Normal {
        let Samples { places, weights, targets } = *samples;
        assert!(places.len() == weights.len() && places.len() == targets.len());
        assert!(places.is_sorted_by_key(|place| place[0]));
        let ends: Vec<usize> =
            steps.theta_h().iter().skip(1).map(|&row| places.partition_point(|p| p[0] < f64::from(row))).collect();
        let count = ends.len();
        let mut layers: Vec<Option<Layer>> = (0..count).map(|_| None).collect();
        share_out(layers.iter_mut().enumerate(), threads, |(k, layer)| {
            // The last layer has what lies on the last row, too.
            let part = if k == 0 { 0 } else { ends[k - 1] }..if k + 1 == count { places.len() } else { ends[k] };
            let samples =
                Samples { places: &places[part.clone()], weights: &weights[part.clone()], targets: &targets[part] };
            *layer = Some(Layer::of(steps, samples));
        });
        Normal::from_cells(steps.nodes(), &layers.into_iter().flatten().collect::<Vec<_>>())
    }

    fn from_cells(nodes: usize, layers: &[Layer]) -> Normal {
        let mut rows: Vec<Vec<(u32, f64)>> = vec![Vec::new(); nodes];
        let mut right = vec![[0.0; 3]; nodes];
        for cell in layers.iter().flat_map(|layer| &layer.cells) {
            let mut pair = 0;
            for i in 0..CORNERS {
                let node = cell.nodes[i] as usize;
                for (sum, x) in right[node].iter_mut().zip(cell.right[i]) {
                    *sum += x;
                }
                for j in i..CORNERS {
                    let other = cell.nodes[j];
                    rows[node].push((other, cell.products[pair]));
                    if i != j {
                        rows[other as usize].push((cell.nodes[i], cell.products[pair]));
                    }
                    pair += 1;
                }
            }
        }
        let (mut starts, mut columns, mut values) = (vec![0], Vec::new(), Vec::new());
        for (node, row) in rows.iter_mut().enumerate() {
            row.push((node as u32, 0.0)); // every row has its diagonal
            row.sort_by_key(|&(column, _)| column); // equal ones stay in order
            for part in row.chunk_by(|a, b| a.0 == b.0) {
                columns.push(part[0].0 as i32);
                values.push(part.iter().map(|&(_, value)| value).sum());
            }
            starts.push(columns.len() as i32);
        }
        Normal { starts, columns, values, right, squares: layers.iter().map(|layer| layer.squares).sum() }
    }

    /// Whether H is a square matrix with a row for each number of b, and all numbers are finite.
    pub fn fits(&self) -> bool {
        let (Normal { starts, columns, values, right, .. }, nodes) = (self, self.nodes());
        starts.len() == nodes + 1
            && starts[0] == 0
            && starts.is_sorted()
            && starts[nodes] as usize == columns.len()
            && columns.len() == values.len()
            && columns.iter().all(|&column| usize::try_from(column).is_ok_and(|column| column < nodes))
            && values.iter().chain(right.as_flattened()).all(|x| x.is_finite())
    }

    /// The number of nodes.
    pub fn nodes(&self) -> usize {
        self.right.len()
    }

    /// The numbers of a row of H: columns and values.
    pub fn row(&self, i: usize) -> impl Iterator<Item = (usize, f64)> {
        let part = self.starts[i] as usize..self.starts[i + 1] as usize;
        self.columns[part.clone()].iter().map(|&j| j as usize).zip(self.values[part].iter().copied())
    }

    /// H's diagonal.
    pub fn diagonal(&self) -> Vec<f64> {
        (0..self.nodes()).map(|i| self.row(i).filter(|&(j, _)| j == i).map(|(_, h)| h).sum()).collect()
    }

    /// Holds the solution to `values`: adds `ridge` times the squared distance from them to the error, which `squares` leaves out.
    /// Panics if there is not one of them for each node.
    pub fn hold(&mut self, values: &[[f64; 3]], ridge: f64) {
        assert_eq!(values.len(), self.nodes());
        for (i, value) in values.iter().enumerate() {
            for k in self.starts[i] as usize..self.starts[i + 1] as usize {
                if self.columns[k] as usize == i {
                    self.values[k] += ridge;
                }
            }
            for (sum, x) in self.right[i].iter_mut().zip(value) {
                *sum += ridge * x;
            }
        }
    }

    /// H z. Panics if z has not three numbers for each node.
    pub fn product(&self, z: &[[f64; 3]]) -> Vec<[f64; 3]> {
        assert_eq!(z.len(), self.nodes());
        (0..z.len())
            .map(|i| {
                let mut sum = [0.0; 3];
                for (j, h) in self.row(i) {
                    for c in 0..3 {
                        sum[c] += h * z[j][c];
                    }
                }
                sum
            })
            .collect()
    }

    /// The solution, by conjugate gradients from `start`, each channel until its residual is at most `tolerance` times b, or for
    /// `most` steps. Preconditioned by the diagonal. Panics if sizes do not fit.
    pub fn solved(&self, start: &[[f64; 3]], tolerance: f64, most: usize) -> Vec<[f64; 3]> {
        let dot = |a: &[[f64; 3]], b: &[[f64; 3]]| {
            a.iter().zip(b).fold([0.0; 3], |sum, (x, y)| std::array::from_fn(|c| sum[c] + x[c] * y[c]))
        };
        let combined = |a: &[[f64; 3]], b: &[[f64; 3]], factor: [f64; 3]| -> Vec<[f64; 3]> {
            a.iter().zip(b).map(|(x, y)| std::array::from_fn(|c| x[c] + factor[c] * y[c])).collect()
        };
        let diagonal = self.diagonal();
        let scaled =
            |r: &[[f64; 3]]| -> Vec<[f64; 3]> { r.iter().zip(&diagonal).map(|(x, &d)| x.map(|x| x / d)).collect() };
        let limit = dot(&self.right, &self.right).map(|square| tolerance * tolerance * square);
        let mut z = start.to_vec();
        let mut residual = combined(&self.right, &self.product(&z), [-1.0; 3]);
        let mut way = scaled(&residual);
        let mut size = dot(&residual, &way);
        for _ in 0..most {
            let left = dot(&residual, &residual);
            let active: [bool; 3] = std::array::from_fn(|c| left[c] > limit[c] && size[c] > 0.0);
            if !active.contains(&true) {
                break;
            }
            let through = self.product(&way);
            let along = dot(&way, &through);
            // A channel that is done stays as it is.
            let step: [f64; 3] = std::array::from_fn(|c| if active[c] { size[c] / along[c] } else { 0.0 });
            z = combined(&z, &way, step);
            residual = combined(&residual, &through, step.map(|x| -x));
            let next = scaled(&residual);
            let before = std::mem::replace(&mut size, dot(&residual, &next));
            let turn = std::array::from_fn(|c| if active[c] { size[c] / before[c] } else { 0.0 });
            way = combined(&next, &way, turn);
        }
        z
    }

    /// The equations of entries that nodes share: the sum of H_ij (f_i · f_j) over the nodes i of one entry and j of another, for
    /// each two of `count` entries, row by row. index: the entry of each node. factors: f, `width` numbers a node. Panics if sizes do
    /// not fit.
    pub fn between_entries(&self, index: &[u16], factors: &[f64], width: usize, count: usize) -> Vec<f64> {
        assert!(index.len() == self.nodes() && factors.len() == width * index.len());
        let mut found = vec![0.0; count * count];
        let of = |i: usize| &factors[width * i..width * (i + 1)];
        for (i, &entry) in index.iter().enumerate() {
            let row = &mut found[count * usize::from(entry)..][..count];
            for (j, h) in self.row(i) {
                let dot: f64 = of(i).iter().zip(of(j)).map(|(a, b)| a * b).sum();
                row[usize::from(index[j])] += h * dot;
            }
        }
        found
    }
}
