//! A range coder over whole-number weights, and whole numbers with adaptive bits: what the bits of a material's nodes are
//! written with.
//!
//! Zeros at the end of a stream are left out; a decoder reads them beyond it. What it finds has one stream alone: any other
//! that would mean the same is refused.

const BOTTOM: u32 = 1 << 24;

/// Chances of bits that learn, out of `EVEN + EVEN`.
pub type Bits = [u32; 24];
const EVEN: u32 = 1 << 11;
pub const FRESH: Bits = [EVEN; 24];
const RATE: u32 = 4;
const LONGEST: u32 = 20;

/// Either end of the coder: an encoder writes what it is given, a decoder finds it.
pub trait Coder {
    /// One of several symbols, by weights that are all above 0 and add up to less than 2^24.
    fn pick(&mut self, symbol: usize, weights: &[u32]) -> usize;

    /// Whether something was found that no encoder writes. All that came after it means nothing.
    fn lost(&self) -> bool {
        false
    }

    /// A bit whose chance to be one learns from it.
    fn bit(&mut self, bit: bool, one: &mut u32) -> bool {
        let bit = self.pick(bit.into(), &[2 * EVEN - *one, *one]) == 1;
        *one = if bit { *one + ((2 * EVEN - *one) >> RATE) } else { *one - (*one >> RATE) };
        bit
    }

    /// A whole number below 2^21 − 1: with 1 added, how many bits it has after the first, one by one; then these.
    fn number(&mut self, value: u32, bits: &mut Bits) -> u32 {
        let length = (value + 1).ilog2();
        let mut found = 0;
        while found < LONGEST && self.bit(found < length, &mut bits[found as usize]) {
            found += 1;
        }
        let mut number = 1;
        for i in (0..found).rev() {
            let bit = (value + 1) >> i & 1 == 1;
            let first = i + 1 == found && i < 4;
            let one = if first { &mut bits[(LONGEST + i) as usize] } else { &mut EVEN.clone() };
            number = 2 * number + u32::from(self.bit(bit, one));
        }
        number - 1
    }

    /// A whole number of either sign: 0, −1, 1, −2, … as 0, 1, 2, 3, …
    fn signed(&mut self, value: i32, bits: &mut Bits) -> i32 {
        let folded = self.number(((value << 1) ^ (value >> 31)) as u32, bits);
        (folded >> 1) as i32 ^ -((folded & 1) as i32)
    }
}

/// After Schindler (1998) and LZMA's: a carry runs back through bytes that are held until none can come any more.
pub struct Encoder {
    low: u64,
    range: u32,
    held: u8,
    full: usize,
    out: Vec<u8>,
}

impl Encoder {
    pub fn new() -> Self {
        Encoder { low: 0, range: u32::MAX, held: 0, full: 0, out: Vec::new() }
    }

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

    pub fn finish(mut self) -> Vec<u8> {
        self.low = roundest(self.low, self.range);
        for _ in 0..5 {
            self.shift();
        }
        self.out.remove(0); // where only a carry out of the whole number could go, which there is none
        while self.out.last() == Some(&0) {
            self.out.pop();
        }
        self.out
    }
}

/// Of all numbers that mean the same, the one with the most zeros at its end.
fn roundest(low: u64, range: u32) -> u64 {
    let last = low + u64::from(range) - 1;
    let cut = |bits: u32| last >> (32 - bits) << (32 - bits);
    (0..=32).map(cut).find(|&number| number >= low).unwrap_or(last)
}

impl Coder for Encoder {
    #[inline(always)]
    fn pick(&mut self, symbol: usize, weights: &[u32]) -> usize {
        let share = self.range / weights.iter().sum::<u32>();
        self.low += u64::from(share * weights[..symbol].iter().sum::<u32>());
        self.range = share * weights[symbol];
        while self.range < BOTTOM {
            self.range <<= 8;
            self.shift();
        }
        symbol
    }
}

pub struct Decoder<'a> {
    code: u32,
    range: u32,
    /// The last four bytes read.
    window: u32,
    /// Whether the code has been beyond all symbols, where no encoder leads.
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

    fn shift(&mut self) {
        let byte = u32::from(*self.data.get(self.read).unwrap_or(&0));
        self.read += 1;
        (self.code, self.window) = (self.code << 8 | byte, self.window << 8 | byte);
    }

    /// Whether the stream is the one that an encoder writes for what was found.
    pub fn is_the_encoders(&self) -> bool {
        let low = self.window.wrapping_sub(self.code);
        let ends = self.read >= self.data.len() && self.data.last() != Some(&0);
        ends && roundest(low.into(), self.range) as u32 == self.window
    }
}

impl Coder for Decoder<'_> {
    #[inline(always)]
    fn pick(&mut self, _: usize, weights: &[u32]) -> usize {
        let total = weights.iter().sum::<u32>();
        let share = self.range / total;
        let at = (self.code / share).min(total - 1);
        self.lost |= self.code / share >= total;
        let (mut symbol, mut below) = (0, 0);
        while below + weights[symbol] <= at {
            below += weights[symbol];
            symbol += 1;
        }
        self.code = self.code.wrapping_sub(share * below);
        self.range = share * weights[symbol];
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

/// Counts the bits that would be written.
pub struct Counter(pub f64);

impl Coder for Counter {
    #[inline(always)]
    fn pick(&mut self, symbol: usize, weights: &[u32]) -> usize {
        self.0 += bits_of(weights[symbol], weights.iter().sum());
        symbol
    }
}

/// What a symbol of so much of the whole weight takes, in bits.
pub fn bits_of(weight: u32, total: u32) -> f64 {
    (f64::from(total) / f64::from(weight)).log2()
}
