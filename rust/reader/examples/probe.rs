//! What the tests ask the crate, in tests/rust, with the answers of tests/cpp/probe.cpp.

use std::io::{Read, Write};

use sommerl::{Brdf, Error, Kind, Library, Sample};

fn opened(path: &str, name: &str) -> Result<Brdf, Error> {
    if name.is_empty() { Brdf::load(path) } else { Library::load(path)?.brdf(name) }
}

/// The place of an error among those of the C++ header.
fn number(error: Error) -> u8 {
    match error {
        Error::File(_) => 2,
        Error::Kind => 4,
        Error::Version => 5,
        Error::Checksum => 6,
        Error::Truncated => 7,
        Error::Name => 8,
        Error::Notes => 9,
        Error::Contents => 10,
        Error::Stream | Error::Nodes(_) => 11,
        Error::Missing => 12,
    }
}

/// Loads what may be anything, and asks what was loaded for some values.
fn attempt(bytes: &[u8], sampled: bool) -> Result<(), Error> {
    let ask = |brdf: Brdf| {
        let f_r = brdf.eval([0.6, 0.0, 0.8], [0.0, 0.6, 0.8]);
        let weight = if sampled { brdf.sample([0.6, 0.0, 0.8], [0.5, 0.25, 0.75]).weight } else { f_r };
        assert!(f_r.iter().chain(&weight).all(|x| x.is_finite()));
    };
    if !bytes.starts_with(b"SMLB") {
        return Brdf::from_bytes(bytes).map(ask);
    }
    let library = Library::from_bytes(bytes.to_vec())?;
    library.entries().iter().try_for_each(|entry| library.brdf(&entry.name).map(ask))
}

fn codes(mut given: &[u8]) -> Vec<u8> {
    let mut found = Vec::new();
    while let Some((length, rest)) = given.split_first_chunk() {
        let (file, rest) = rest.split_at(u64::from_le_bytes(*length) as usize);
        found.push(attempt(file, found.len() % 32 == 0).map_or_else(number, |()| 0));
        given = rest;
    }
    found
}

fn called(brdf: &Brdf, call: &str, given: &[u8]) -> Vec<u8> {
    let numbers: Vec<f64> = given.as_chunks().0.iter().map(|&bytes| f64::from_le_bytes(bytes)).collect();
    let answer = |row: &[f64; 6]| {
        let (a, b) = ([row[0], row[1], row[2]], [row[3], row[4], row[5]]);
        let found = match call {
            "eval" => (brdf.eval(a, b), [0.0; 3], [0.0; 2]),
            "pdf" => ([0.0; 3], [0.0; 3], [brdf.pdf(a, b); 2]),
            _ => {
                let Sample { wi, pdf, weight } = brdf.sample(a, b);
                (weight, wi, [pdf, brdf.pdf(wi, a)])
            }
        };
        [&found.0[..], &found.1, &found.2].concat().into_iter().flat_map(f64::to_le_bytes).collect::<Vec<_>>()
    };
    numbers.as_chunks().0.iter().flat_map(answer).collect()
}

fn facts(brdf: &Brdf) -> String {
    let kind = match brdf.kind() {
        Kind::Cells => 0,
        Kind::Nodes => 1,
        Kind::Factored => 2,
    };
    let flags = [brdf.reciprocal(), brdf.mirrored(), brdf.signed(), brdf.trilinear()].map(u8::from);
    let [a, b, c, d] = flags;
    format!("{}\n{}\n{}\n{kind}\n{a}\n{b}\n{c}\n{d}\n", brdf.name(), brdf.source_sha256(), brdf.notes())
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let mut given = Vec::new();
    std::io::stdin().read_to_end(&mut given).expect("bytes on standard input");
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let answer = match words[..] {
        ["codes"] => Ok(codes(&given)),
        ["facts", path, name] => opened(path, name).map(|brdf| facts(&brdf).into_bytes()),
        ["call", path, name, _, call] => opened(path, name).map(|brdf| called(&brdf, call, &given)),
        _ => panic!("expected codes, facts or call"),
    };
    let failed = answer.is_err();
    let said = answer.unwrap_or_else(|error| format!("{error}\n").into_bytes());
    std::io::stdout().write_all(&said).expect("standard output");
    std::process::exit(failed.into());
}
