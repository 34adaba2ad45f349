//! Half vectors from a table for each elevation of the viewer: `sampling/half_vector.py` explains it, with the same names.

use crate::material::{Material, bin};

const ROWS: usize = 20;
const COLUMNS: usize = 8;
const ELEVATIONS: usize = 12;
const CELLS: usize = ROWS * COLUMNS;
const SLOTS: usize = 256;
const WHOLE: usize = CELLS * SLOTS;
const FINER: usize = 3;
const POINTS: usize = FINER * FINER;
const BETWEEN: usize = 2 * ELEVATIONS - 1;
const LOWEST: f64 = 1e-4;
const DIFFUSE: f64 = 0.01;
const NEIGHBOUR: f64 = 0.07;
const TINY: f64 = 1e-9;
const SMALLEST: f64 = 1e-35;

/// The words of all elevations: a probability, another cell, and how many slots that one has.
pub struct Sampler(Vec<u32>);

/// Of each cell, for one elevation: root mean square of light, brightest light, cosine.
struct Light {
    rms: [f64; CELLS],
    brightest: [f64; CELLS],
    even: [f64; CELLS],
}

impl Sampler {
    pub fn fitted(material: &Material) -> Sampler {
        let lights: Vec<Light> = (0..BETWEEN).map(|e| light(material, e)).collect();
        Sampler((0..ELEVATIONS).flat_map(|e| words(&lights, e)).collect())
    }

    /// A direction to the light, and its density; 0 if none was drawn.
    pub fn draw(&self, wo: [f64; 3], u: [f64; 3]) -> ([f64; 3], f64) {
        let (first, t) = elevation(wo[2]);
        let (rest, first_of_slot) = if u[0] < t { (u[0] / t, first + CELLS) } else { ((u[0] - t) / (1.0 - t), first) };
        let slot = bin(rest * WHOLE as f64, WHOLE);
        let word = self.0[slot / SLOTS + first_of_slot];
        let other = slot % SLOTS < (word >> 24) as usize;
        let cell = if other { (word >> 16 & 255) as usize } else { slot / SLOTS };
        let side = 2.0 * u[2] - 1.0;
        let s = ((cell / COLUMNS) as f64 + u[1]) / ROWS as f64;
        let c = ((cell % COLUMNS) as f64 + side.abs()) * (2.0 / COLUMNS as f64);
        let (wi, solid_angle) = mirrored(s, c, side, wo);
        let drawn = wi[2] > 0.0 && solid_angle > SMALLEST;
        (wi, if drawn { self.share(first, t, cell) / solid_angle } else { 0.0 })
    }

    /// The density of a direction to the light.
    pub fn density(&self, wi: [f64; 3], wo: [f64; 3]) -> f64 {
        let (x, y, z) = (wo[0] + TINY, wo[1], wo[2].max(LOWEST));
        let (hx, hy, hz) = (wi[0] + wo[0] + TINY, wi[1] + wo[1], wi[2] + z);
        let (along, across) = (hx * x + hy * y, hx * y - hy * x);
        let flat = (hx * hx + hy * hy).max(TINY * TINY);
        let ratio = flat / ((flat + hz * hz) * extent(along, z * z * flat));
        let s = ratio.min(1.0).sqrt().sqrt().sqrt();
        let rim = 1.0 / (along.abs() + across.abs()).max(TINY * TINY);
        let row = bin(s * ROWS as f64, ROWS);
        let column = bin((1.0 - along * rim) * (COLUMNS / 2) as f64, COLUMNS);
        let (first, t) = elevation(wo[2]);
        self.share(first, t, column + COLUMNS * row) * (s * hz) * ((x * x + y * y) * (rim * rim) / 32.0)
    }

    fn share(&self, first: usize, t: f64, cell: usize) -> f64 {
        let [here, next] = [first, first + CELLS].map(|first| f64::from(self.0[first + cell] & 0xffff));
        (here + t * (next - here)) / SLOTS as f64
    }
}

/// The number of the first cell of the elevation below, and the share of the next one.
fn elevation(cos_o: f64) -> (usize, f64) {
    let x = cos_o.max(0.0).sqrt() * (ELEVATIONS - 1) as f64;
    let node = bin(x, ELEVATIONS - 1);
    (CELLS * node, x - node as f64)
}

fn extent(along: f64, upright2: f64) -> f64 {
    let r = (along * along + upright2).sqrt();
    let a = r + along.abs();
    (if along < 0.0 { upright2 } else { a * a }) / (2.0 * r * a)
}

/// The direction to the light for a point (s, c) of the unit square, and the solid angle per area of the square.
fn mirrored(s: f64, c: f64, side: f64, wo: [f64; 3]) -> ([f64; 3], f64) {
    let x = 1.0 - c;
    let y = (1.0 - x.abs()) * if side < 0.0 { -1.0 } else { 1.0 };
    let round = x * x + y * y;
    let (wx, wy, wz) = (wo[0] + TINY, wo[1], wo[2].max(LOWEST));
    let across = wx * wx + wy * wy;
    let scale = 1.0 / (round * across).sqrt();
    let tilt = x * across * scale;
    let extent = extent(tilt, wz * wz);
    let s6 = (s * s) * (s * s) * (s * s);
    let sin2 = s6 * (s * s) * extent;
    let (sin, cos) = (sin2.sqrt(), (1.0 - sin2).sqrt());
    let dot = sin * tilt + cos * wz;
    let planar = 2.0 * dot * sin * scale;
    let wi = [planar * (x * wx - y * wy) - wx, planar * (x * wy + y * wx) - wy, 2.0 * dot * cos - wz];
    (wi, 64.0 * (s6 * s) * extent * dot / (cos * round))
}

fn light(material: &Material, e: usize) -> Light {
    let x = e as f64 / (BETWEEN - 1) as f64;
    let z = (x * x).max(LOWEST);
    let wo = [(1.0 - z * z).sqrt(), 0.0, z];
    let mut made = Light { rms: [0.0; CELLS], brightest: [f64::NEG_INFINITY; CELLS], even: [0.0; CELLS] };
    let mut brightest = [[f64::NEG_INFINITY; 3]; CELLS];
    let (mut albedo, mut sum) = ([0.0; 3], 0.0);
    for (cell, brightest) in brightest.iter_mut().enumerate() {
        let mut total = [0.0; 3];
        for point in 0..POINTS {
            let i = cell / COLUMNS * FINER + point / FINER;
            let j = cell % COLUMNS * FINER + point % FINER;
            let s = (i as f64 + 0.5) / (FINER * ROWS) as f64;
            let c = 2.0 * ((j as f64 + 0.5) / (FINER * COLUMNS) as f64);
            let (wi, solid_angle) = mirrored(s, c, 1.0, wo);
            let cosine = wi[2].max(0.0) * solid_angle;
            made.even[cell] += cosine / POINTS as f64;
            for (n, f_r) in material.eval(wi, wo).into_iter().enumerate() {
                let value = f_r * cosine;
                made.rms[cell] += value * value;
                total[n] += value;
                brightest[n] = brightest[n].max(value);
            }
        }
        made.rms[cell] = (made.rms[cell] / (3 * POINTS) as f64).sqrt();
        sum += made.rms[cell];
        albedo = [0, 1, 2].map(|c| albedo[c] + total[c] / POINTS as f64);
    }
    let or_1 = |x: f64| if x > 0.0 { x } else { 1.0 };
    for (cell, brightest) in brightest.iter().enumerate() {
        made.rms[cell] /= or_1(sum);
        let relative = [0, 1, 2].map(|c| brightest[c] / or_1(albedo[c]));
        made.brightest[cell] = relative.into_iter().fold(f64::NEG_INFINITY, f64::max);
    }
    made
}

/// The words of one elevation: probabilities, and Vose's alias table in whole slots.
fn words(lights: &[Light], e: usize) -> [u32; CELLS] {
    let own = &lights[2 * e];
    let mut p = [0.0; CELLS];
    for (cell, p) in p.iter_mut().enumerate() {
        let (row, column) = (cell / COLUMNS, cell % COLUMNS);
        let mut near = own.brightest[cell];
        for light in &lights[(2 * e).saturating_sub(2)..(2 * e + 3).min(BETWEEN)] {
            for i in row.saturating_sub(1)..(row + 2).min(ROWS) {
                for j in column.saturating_sub(1)..(column + 2).min(COLUMNS) {
                    near = near.max(light.brightest[COLUMNS * i + j]);
                }
            }
        }
        *p = own.rms[cell].max(NEIGHBOUR * near);
    }
    let (total, even): (f64, f64) = (p.iter().sum(), own.even.iter().sum());
    let (mut units, mut rest) = ([0_usize; CELLS], [0.0; CELLS]);
    for cell in 0..CELLS {
        let cosine = own.even[cell] / even;
        let glossy = if total > 0.0 { p[cell] / total } else { cosine };
        let exact = ((1.0 - DIFFUSE) * glossy + DIFFUSE * cosine) * (WHOLE - CELLS) as f64;
        units[cell] = 1 + exact as usize;
        rest[cell] = exact - exact.floor();
    }
    for _ in 0..WHOLE.saturating_sub(units.iter().sum()).min(CELLS) {
        let most = (1..CELLS).fold(0, |most, cell| if rest[cell] > rest[most] { cell } else { most });
        units[most] += 1;
        rest[most] = -1.0;
    }
    let (mut other, mut taken, mut left) = ([0; CELLS], [0; CELLS], units);
    let (mut poor, mut rich): (Vec<usize>, Vec<usize>) = (0..CELLS).partition(|&cell| units[cell] < SLOTS);
    while let (Some(one), Some(&giver)) = (poor.pop(), rich.last()) {
        other[one] = giver;
        taken[one] = SLOTS - left[one];
        left[giver] -= taken[one];
        if left[giver] < SLOTS {
            rich.pop();
            poor.push(giver);
        }
    }
    core::array::from_fn(|cell| (units[cell] | other[cell] << 16 | taken[cell] << 24) as u32)
}
