//! Factored BRDFs: sums of products of small tables. `factored/material.py` has the formulas.

use core::f64::consts::PI;

use sommerl_kernels::angle;

use crate::Error;
use crate::bytes::{Reader, half, inflated};
use crate::material::{Material, Values, bin};
use crate::smrl::{Origin, read_head};

const ELEVATIONS: usize = 32;
const ROWS: usize = 90;
const COLUMNS: usize = 48;
const LEAST_COSINE: f64 = 0.03;
const UPRIGHT: f64 = 1e-9;
const LONGEST_FILE: usize = 1 << 20;

/// The tables, one row after the other; `u` times the scale of its term.
pub struct Factors {
    lobes: usize,
    terms: usize,
    f: Vec<f32>,
    u: Vec<f32>,
    v: Vec<f32>,
}

impl Factors {
    /// f_r of one pair, whose components are finite and which is above the horizon.
    pub fn eval(&self, wi: [f64; 3], wo: [f64; 3]) -> [f64; 3] {
        let &Factors { lobes, terms, ref f, ref u, ref v } = self;
        let all = lobes * terms;
        let (hx, hy, hz) = (wi[0] + wo[0], wi[1] + wo[1], wi[2] + wo[2]);
        let (x, y) = (wo[0] + UPRIGHT, wo[1]);
        let theta_h = angle((hx * hx + hy * hy).sqrt(), hz);
        let phi_h = angle((hy * x - hx * y).abs(), hx * x + hy * y);
        let theta_o = angle((wo[0] * wo[0] + wo[1] * wo[1]).sqrt(), wo[2]);
        let (row, s) = between((theta_h * (2.0 / PI)).sqrt() * ROWS as f64, ROWS);
        let (column, t) = between(phi_h * (COLUMNS as f64 / PI), COLUMNS);
        let (node, e) = between(theta_o * (2.0 * ELEVATIONS as f64 / PI), ELEVATIONS);
        let mut sum = [0.0; 3];
        for lobe in 0..lobes {
            let mut g = 0.0;
            for k in lobe * terms..(lobe + 1) * terms {
                g += mixed(u, all * row + k, all, s) * mixed(v, all * column + k, all, t);
            }
            for (c, sum) in sum.iter_mut().enumerate() {
                *sum += g * mixed(f, 3 * (lobes * node + lobe) + c, 3 * lobes, e);
            }
        }
        sum.map(|x| x / wi[2].max(LEAST_COSINE))
    }
}

/// Between an element and the one a stride after it; tables are in single precision, and so is their difference.
fn mixed(table: &[f32], at: usize, stride: usize, share: f64) -> f64 {
    let (here, next) = (table[at], table[at + stride]);
    f64::from(here) + share * f64::from(next - here)
}

/// The middles of intervals about a place: the first one's number, and the share of the next.
fn between(place: f64, count: usize) -> (usize, f64) {
    let at = (place - 0.5).max(0.0).min(count as f64 - 1.0);
    let first = bin(at, count - 1);
    (first, at - first as f64)
}

/// A material from the bytes of a file.
pub fn read_fbrdf(bytes: &[u8]) -> Result<Material, Error> {
    if bytes.len() > LONGEST_FILE {
        return Err(Error::Contents);
    }
    let mut reader = Reader(bytes);
    read_head(&mut reader, b"FBRD", 1)?;
    let Origin { name, source_sha256 } = Origin::read(&mut reader)?;
    let (lobes, terms) = (usize::from(reader.u8()?), usize::from(reader.u8()?));
    let all = lobes * terms;
    if !(1..=256).contains(&all) || lobes > 32 || terms > 32 {
        return Err(Error::Contents);
    }
    let sizes = [ELEVATIONS * 3 * lobes, ROWS * all, COLUMNS * all];
    let n = sizes.iter().sum();
    let payload = inflated(reader.0, 2 * n + 4 * all)?;
    let (halves, scales) = payload.split_at(2 * n);
    let (low, high) = halves.split_at(n);
    let mut f: Vec<f32> = low.iter().zip(high).map(|(&low, &high)| half(u16::from_le_bytes([low, high]))).collect();
    if !f.iter().all(|value| (0.0..=1.0).contains(value)) {
        return Err(Error::Contents);
    }
    let mut u = f.split_off(sizes[0]);
    let v = u.split_off(sizes[1]);
    let mut scales = Reader(scales);
    for term in 0..all {
        let scale = scales.f32()?;
        if !(0.0..=1e30).contains(&scale) {
            return Err(Error::Contents);
        }
        u.iter_mut().skip(term).step_by(all).for_each(|value| *value *= scale);
    }
    let values = Values::Factors(Factors { lobes, terms, f, u, v });
    let (reciprocal, mirrored, signed) = (false, true, false);
    Ok(Material { name, source_sha256, notes: String::new(), reciprocal, mirrored, signed, values })
}
