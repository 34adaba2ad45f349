//! The values that nodes choose from, by their codes.

use crate::error::Error;

/// What a file can hold.
pub const MOST_ENTRIES: usize = 1 << 10;
pub const HIGHEST_GAIN: i32 = (1 << 12) - 1;
pub const WIDEST_SHAPE: i32 = 1 << 10;
/// Gains whose codes differ by that are an octave apart.
const OCTAVE: f64 = 128.0;
/// Coordinates of shapes whose codes differ by that are 1 apart.
const UNIT: f64 = 64.0;

/// Gains and shapes, by their codes: what a code stands for is in docs/format.md.
#[derive(Clone, Debug, PartialEq)]
pub struct Palette {
    /// Increasing. A negative code stands for minus what its opposite stands for.
    pub gains: Vec<i32>,
    /// Two coordinates each, the first of which does not decrease from one shape to the next.
    pub shapes: Vec<[i32; 2]>,
}

impl Palette {
    /// Whether a file can hold the palette. Gives `Error::PaletteSize` or `Error::PaletteCodes` if not.
    pub fn check(&self) -> Result<(), Error> {
        let Palette { gains, shapes } = self;
        if ![gains.len(), shapes.len()].iter().all(|entries| (1..=MOST_ENTRIES).contains(entries)) {
            return Err(Error::PaletteSize);
        }
        let ordered = gains.is_sorted_by(|a, b| a < b) && shapes.is_sorted_by(|a, b| a[0] <= b[0]);
        let within = |most: i32, code: &i32| (-most..=most).contains(code);
        let gains = gains.iter().all(|code| within(HIGHEST_GAIN, code));
        let shapes = shapes.iter().flatten().all(|code| within(WIDEST_SHAPE, code));
        if ordered && gains && shapes { Ok(()) } else { Err(Error::PaletteCodes) }
    }

    /// What the codes of gains stand for.
    pub fn gain_values(&self) -> Vec<f64> {
        let value = |code: &i32| {
            let (octave, place) = (code.abs() / OCTAVE as i32, code.abs() % OCTAVE as i32);
            let gain = 0.5 * (f64::from(1_u32 << octave) * (1.0 + f64::from(place) / OCTAVE) - 1.0);
            if *code < 0 { -gain } else { gain }
        };
        self.gains.iter().map(value).collect()
    }

    /// What the codes of shapes stand for: red, green and blue, whose mean is 1.
    pub fn shape_values(&self) -> Vec<[f64; 3]> {
        let value = |code: &[i32; 2]| {
            let (red_blue, green) = (f64::from(code[0]) / UNIT, 1.0 + f64::from(code[1]) / UNIT * 2.0 / 3.0);
            [(3.0 - green + red_blue) / 2.0, green, (3.0 - green - red_blue) / 2.0]
        };
        self.shapes.iter().map(value).collect()
    }

    /// What the model sees of the entries: the octave of each gain, and the first and the second coordinate of each shape.
    pub(crate) fn places(&self) -> [Vec<f64>; 3] {
        let gains = self.gains.iter().map(|&code| f64::from(code) / OCTAVE).collect();
        let [first, second] = [0, 1].map(|axis| self.shapes.iter().map(|s| f64::from(s[axis]) / UNIT).collect());
        [gains, first, second]
    }
}
