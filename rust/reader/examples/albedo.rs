//! Reads a material, evaluates it, and estimates its albedo by sampling: cargo run --example albedo -- gold.smrl

use sommerl::{Brdf, Error};

fn main() -> Result<(), Error> {
    let brdf = Brdf::load(std::env::args().nth(1).unwrap_or("material.smrl".into()))?;
    let wo = [0.6, 0.0, 0.8];
    println!("{}: f_r = {:?} 1/sr", brdf.name(), brdf.eval([0.0, 0.0, 1.0], wo));

    let samples = 20_000;
    let mut sum = 0.0;
    for i in 1..=samples {
        // Evenly spread points: multiples of powers of the root of x⁴ = x + 1 (Roberts 2018).
        let u = [0.819_172_5, 0.671_043_6, 0.549_700_5].map(|step| (f64::from(i) * step).fract());
        sum += brdf.sample(wo, u).weight.iter().sum::<f64>() / 3.0; // f_r cos θ_i / pdf
    }
    println!("albedo = {}", sum / f64::from(samples));
    Ok(())
}
