//! Lookup of many pairs of directions: what materials on cells and on nodes have in common. The formulas are those of
//! `reflectance/half_diff.py`, in the same order; the arctangent is our own, so that it vectorises, and within 2 ulp of the
//! library's.

use sommerl_simd::{InstructionSet, for_each_instruction_set};

use crate::threads::share_out;

/// Pairs calculated together, stage by stage, in loops that vectorise.
pub const BATCH: usize = 64;
type Batch = [f64; BATCH];
/// Memory for numbers of a batch that one stage leaves to the next.
pub type Room = [Batch; 4];

/// What pairs of directions are evaluated for.
pub trait Material: Sync {
    /// Writes f_r of up to BATCH pairs, every element of `out`: `Pairs::known` where it is not None. Implementations are marked
    /// `#[inline(always)]`, because they are compiled once for each instruction set.
    fn batch(&self, pairs: &Pairs, room: &mut Room, out: &mut [[f64; 3]]);
}

/// Writes f_r of each pair (wi, wo) of directions to `out`, on several threads: NaN where a component is NaN or infinite, else 0
/// where either direction is not above the horizon. Every element is written: `out` may be memory that holds anything.
pub fn eval(
    wi: &[[f64; 3]],
    wo: &[[f64; 3]],
    material: &impl Material,
    set: InstructionSet,
    threads: usize,
    out: &mut [[f64; 3]],
) {
    let share = wi.len().div_ceil(threads.max(1)).next_multiple_of(BATCH).max(BATCH);
    if wi.len() <= share {
        return batches(set, wi, wo, material, out); // a thread takes longer to start than a few pairs
    }
    let parts = wi.chunks(share).zip(wo.chunks(share)).zip(out.chunks_mut(share));
    share_out(parts, threads, |((wi, wo), out)| batches(set, wi, wo, material, out));
}

for_each_instruction_set! {
    fn batches<M: Material>(wi: &[[f64; 3]], wo: &[[f64; 3]], material: &M, out: &mut [[f64; 3]]) {
        let mut pairs = Pairs([[0.0; BATCH]; 7]);
        let mut room = [[0.0; BATCH]; 4];
        for ((wi, wo), out) in wi.chunks(BATCH).zip(wo.chunks(BATCH)).zip(out.chunks_mut(BATCH)) {
            pairs.set(wi, wo);
            material.batch(&pairs, &mut room, out);
        }
    }
}

/// A batch of pairs: each component of all wi and wo, and for each pair 1 if the material has to be asked, else what `known` gives.
/// After the last pair of all, there are others from earlier batches.
pub struct Pairs([Batch; 7]);

impl Pairs {
    #[inline(always)]
    fn set(&mut self, wi: &[[f64; 3]], wo: &[[f64; 3]]) {
        for (i, (a, b)) in wi.iter().zip(wo).enumerate() {
            for j in 0..3 {
                self.0[j][i] = a[j];
                self.0[j + 3][i] = b[j];
            }
        }
        let [x, y, z, u, v, w, known] = &mut self.0;
        for i in 0..BATCH {
            // 0 if all are finite, else NaN.
            let all = (x[i] * 0.0 + y[i] * 0.0 + z[i] * 0.0) + (u[i] * 0.0 + v[i] * 0.0 + w[i] * 0.0);
            known[i] = all + f64::from(u8::from((z[i] > 0.0) & (w[i] > 0.0)));
        }
    }

    /// What is known of a pair without the material: NaN if a component is NaN or infinite, else 0 if either direction is not above
    /// the horizon. None where the material has to be asked.
    #[inline(always)]
    pub fn known(&self, i: usize) -> Option<f64> {
        let known = self.0[6][i];
        (known != 1.0).then_some(known)
    }

    /// The two directions of a pair.
    #[inline(always)]
    pub fn directions(&self, i: usize) -> ([f64; 3], [f64; 3]) {
        let pairs = &self.0;
        ([pairs[0][i], pairs[1][i], pairs[2][i]], [pairs[3][i], pairs[4][i], pairs[5][i]])
    }
}

/// θ_h, θ_d and φ_d of a pair, as `half_diff` of Python gives them; φ_d is folded to its range.
#[inline(always)]
pub fn half_diff(wi: [f64; 3], wo: [f64; 3], reciprocal: bool, mirrored: bool) -> [f64; 3] {
    let (sx, sy, sz) = (wi[0] + wo[0], wi[1] + wo[1], wi[2] + wo[2]);
    let (vx, vy, vz) = (wi[0] - wo[0], wi[1] - wo[1], wi[2] - wo[2]);
    let s = ((sx * sx + sy * sy) + sz * sz).sqrt();
    let v = ((vx * vx + vy * vy) + vz * vz).sqrt();
    let theta_h = angle((sx * sx + sy * sy).sqrt(), sz);
    let theta_d = angle(v, s);
    let x = 0.0 - vz * s;
    let y = (vy * sx - vx * sy) + 0.0;
    if mirrored {
        return [theta_h, theta_d, angle(y.abs(), if reciprocal { x.abs() } else { x })];
    }
    let other = (y < 0.0) | ((y == 0.0) & (x < 0.0));
    let (up, across) = if other { (-y, -x + 0.0) } else { (y, x + 0.0) };
    let folded = angle(up, across);
    let phi_d = if reciprocal | !other { folded } else { folded + std::f64::consts::PI };
    [theta_h, theta_d, phi_d]
}

/// The angle of (x, y) for y >= 0, in [0, π]; 0 for (0, 0). Within 2 ulp. The reduction to |t| < 7/16 and the polynomial are those
/// of fdlibm (Sun Microsystems 1993); here without branches and with one division, so that it vectorises.
#[inline(always)]
pub fn angle(y: f64, x: f64) -> f64 {
    use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};
    const ATAN_HALF: f64 = 4.636_476_090_008_061e-1;
    let a = x.abs();
    let steep = y > a;
    let (small, large) = if steep { (a, y) } else { (y, a) };
    // atan t = atan ½ + atan((2 t - 1) / (2 + t)) = π/4 + atan((t - 1) / (t + 1))
    let (middle, upper) = (small > 0.4375 * large, small > 0.6875 * large);
    let top = if middle { 2.0 * small - large } else { small };
    let bottom = if middle { 2.0 * large + small } else { large };
    let top = if upper { small - large } else { top };
    let bottom = if upper { small + large } else { bottom };
    let base = if middle { ATAN_HALF } else { 0.0 };
    let rest = if middle { 2.269_877_745_296_168_7e-17 } else { 0.0 };
    let base = if upper { FRAC_PI_4 } else { base };
    let rest = if upper { 3.061_616_997_868_383e-17 } else { rest };
    let t = top / if bottom == 0.0 { 1.0 } else { bottom };
    let (z, w) = (t * t, (t * t) * (t * t));
    let odd = 3.333_333_333_333_293e-1
        + w * (1.428_571_427_250_346_6e-1
            + w * (9.090_887_133_436_507e-2
                + w * (6.661_073_137_387_531e-2 + w * (4.976_877_994_615_932e-2 + w * 1.628_582_011_536_578_2e-2))));
    let even = -1.999_999_999_987_648_3e-1
        + w * (-1.111_111_040_546_235_6e-1
            + w * (-7.691_876_205_044_83e-2 + w * (-5.833_570_133_790_573e-2 + w * -3.653_157_274_421_691_6e-2)));
    let angle = base - ((t * (z * odd + w * even) - rest) - t);
    let angle = if steep { FRAC_PI_2 - angle } else { angle };
    if x < 0.0 { PI - angle } else { angle }
}
