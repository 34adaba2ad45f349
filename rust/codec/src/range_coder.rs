//! A range coder for symbols with whole-number weights, and for numbers whose bits' chances adapt.
//!
//! Zeros at the end of a stream are not stored: a decoder that has come to the end reads zeros. Each sequence of symbols has one
//! stream: `Decoder::is_the_encoders` tells whether the one that was read is the one that an encoder writes.

const BOTTOM: u32 = 1 << 24;
/// Weights that a decoder passes over at once, by their sum.
const AT_ONCE: usize = 16;

/// The chances of 24 bits to be one, out of `2 * EVEN`; they adapt to the bits that come.
pub type Context = [u32; 24];
const EVEN: u32 = 1 << 11;
/// A context before the first bit.
pub const FRESH: Context = [EVEN; 24];
/// A bit moves its chance by 2^-RATE of the way.
const RATE: u32 = 4;
/// The most bits that a number has after the first.
const LONGEST: u32 = 20;

/// How likely symbols are.
#[derive(Clone, Copy)]
pub struct Weights<'a> {
    /// Those of all symbols, all above 0.
    pub each: &'a [u32],
    /// Their sum, which is below 2^24.
    pub total: u32,
}

/// What is common to writing and to reading, so that a part of the format is one function for both. The function passes each value
/// and goes on with the one that is returned. An `Encoder` writes the value that is passed, and returns it. A `Decoder` ignores
/// the value that is passed, for which 0 does, and returns the one that it reads. A `BitCounter` adds up what the value takes, and
/// returns it.
pub trait Coder {
    /// One of several symbols.
    fn pick(&mut self, symbol: usize, weights: Weights<'_>) -> usize;

    /// Whether a decoder has read what is no symbol. What it has returned since then means nothing.
    fn lost(&self) -> bool {
        false
    }

    /// A bit. `one`: its chance to be one, which adapts to it.
    fn bit(&mut self, bit: bool, one: &mut u32) -> bool {
        let weights = Weights { each: &[2 * EVEN - *one, *one], total: 2 * EVEN };
        let bit = self.pick(bit.into(), weights) == 1;
        *one = if bit { *one + ((2 * EVEN - *one) >> RATE) } else { *one - (*one >> RATE) };
        bit
    }

    /// A whole number below 2^21 − 1. With 1 added, it has a leading one and n bits after it: n is coded first, as n ones and a
    /// zero; then the bits, of which the highest has a chance that adapts if n < 5, and the others are even.
    fn number(&mut self, value: u32, context: &mut Context) -> u32 {
        let length = (value + 1).ilog2();
        let mut found = 0;
        while found < LONGEST && self.bit(found < length, &mut context[found as usize]) {
            found += 1;
        }
        let mut number = 1;
        for i in (0..found).rev() {
            let bit = (value + 1) >> i & 1 == 1;
            let first = i + 1 == found && i < 4;
            let one = if first { &mut context[(LONGEST + i) as usize] } else { &mut EVEN.clone() };
            number = 2 * number + u32::from(self.bit(bit, one));
        }
        number - 1
    }

    /// A whole number of either sign: 0, −1, 1, −2, … are coded as 0, 1, 2, 3, …
    fn signed(&mut self, value: i32, context: &mut Context) -> i32 {
        let folded = self.number(((value << 1) ^ (value >> 31)) as u32, context);
        (folded >> 1) as i32 ^ -((folded & 1) as i32)
    }
}

/// Writes symbols. After Schindler (1998) and the coder of LZMA: the last byte before a run of 0xff, and the run, are held back,
/// because a carry out of the bytes after them would change them.
pub struct Encoder {
    /// The lower end of the interval, with a carry in bit 32; and its width.
    low: u64,
    range: u32,
    /// The byte that is held back, and the number of bytes of 0xff after it.
    held: u8,
    full: usize,
    out: Vec<u8>,
}

impl Encoder {
    pub fn new() -> Self {
        Encoder { low: 0, range: u32::MAX, held: 0, full: 0, out: Vec::new() }
    }

    /// Moves the highest byte of `low` out.
    fn shift(&mut self) {
        let carry = self.low > u32::MAX.into();
        if carry || self.low < 0xff00_0000 {
            self.out.push(self.held.wrapping_add(carry.into()));
            self.out.extend(std::iter::repeat_n(if carry { 0 } else { 0xff }, self.full));
            (self.full, self.held) = (0, (self.low >> 24) as u8);
        } else {
            self.full += 1;
        }
        self.low = (self.low & 0x00ff_ffff) << 8;
    }

    /// The stream: the shortest that a decoder reads the same symbols from.
    pub fn finish(mut self) -> Vec<u8> {
        self.low = roundest(self.low, self.range);
        for _ in 0..5 {
            self.shift();
        }
        self.out.remove(0); // the byte held at first, for a carry that cannot come: it is 0
        while self.out.last() == Some(&0) {
            self.out.pop();
        }
        self.out
    }
}

/// Of the numbers in an interval, the one with the most zeros at its end.
fn roundest(low: u64, range: u32) -> u64 {
    let last = low + u64::from(range) - 1;
    let cut = |bits: u32| last >> (32 - bits) << (32 - bits);
    (0..=32).map(cut).find(|&number| number >= low).unwrap_or(last)
}

impl Coder for Encoder {
    #[inline(always)]
    fn pick(&mut self, symbol: usize, weights: Weights<'_>) -> usize {
        let share = self.range / weights.total;
        self.low += u64::from(share * weights.each[..symbol].iter().sum::<u32>());
        self.range = share * weights.each[symbol];
        while self.range < BOTTOM {
            self.range <<= 8;
            self.shift();
        }
        symbol
    }
}

/// Reads symbols, of which there are as many as are asked for.
pub struct Decoder<'a> {
    /// The distance of the stream's number from the lower end of the interval, and the interval's width.
    code: u32,
    range: u32,
    /// The last four bytes read.
    window: u32,
    /// Whether the code has ever been beyond the last symbol, which no encoder leads to.
    lost: bool,
    data: &'a [u8],
    read: usize,
}

impl<'a> Decoder<'a> {
    pub fn new(data: &'a [u8]) -> Self {
        let mut decoder = Decoder { code: 0, range: u32::MAX, window: 0, lost: false, data, read: 0 };
        for _ in 0..4 {
            decoder.shift();
        }
        decoder
    }

    /// Moves the next byte in.
    fn shift(&mut self) {
        let byte = u32::from(*self.data.get(self.read).unwrap_or(&0));
        self.read += 1;
        (self.code, self.window) = (self.code << 8 | byte, self.window << 8 | byte);
    }

    /// Whether the stream is the one that an encoder writes for the symbols that were read.
    pub fn is_the_encoders(&self) -> bool {
        let low = self.window.wrapping_sub(self.code);
        let ends = self.read >= self.data.len() && self.data.last() != Some(&0);
        ends && roundest(low.into(), self.range) as u32 == self.window
    }
}

impl Coder for Decoder<'_> {
    #[inline(always)]
    fn pick(&mut self, _: usize, Weights { each, total }: Weights<'_>) -> usize {
        let share = self.range / total;
        let at = (self.code / share).min(total - 1);
        self.lost |= self.code / share >= total;
        let (mut symbol, mut below) = (0, 0);
        for part in each.chunks_exact(AT_ONCE) {
            let sum = part.iter().sum::<u32>();
            if below + sum > at {
                break;
            }
            (symbol, below) = (symbol + AT_ONCE, below + sum);
        }
        while below + each[symbol] <= at {
            below += each[symbol];
            symbol += 1;
        }
        self.code = self.code.wrapping_sub(share * below);
        self.range = share * each[symbol];
        while self.range < BOTTOM {
            self.range <<= 8;
            self.shift();
        }
        symbol
    }

    #[inline(always)]
    fn lost(&self) -> bool {
        self.lost
    }
}

/// Adds up the bits that symbols take.
pub struct BitCounter(pub f64);

impl Coder for BitCounter {
    #[inline(always)]
    fn pick(&mut self, symbol: usize, weights: Weights<'_>) -> usize {
        self.0 += bits_of(weights.each[symbol], weights.total);
        symbol
    }
}

/// The bits that a symbol takes. total: the sum of all symbols' weights.
pub fn bits_of(weight: u32, total: u32) -> f64 {
    (f64::from(total) / f64::from(weight)).log2()
}
