//! An adaptive binary arithmetic coder, and whole numbers on top of it.
//!
//! Encoding and decoding run through one trait, [`Coder`], so that a format is written once and cannot disagree with
//! itself: the encoder is told each value, the decoder answers it. All decisions are integer arithmetic, so bytes
//! decode alike on every machine.

use super::RecordError;

/// The chance that a bit is set, learned as bits go by.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bit {
    /// Chance of a one in 1/65536.
    ones: u16,
    /// Bits seen, and how sure the start was.
    seen: u16,
}

impl Bit {
    /// A start that counts as much as this many bits seen.
    const CONFIDENCE: u16 = 4;
    /// Memory in bits: what lies further back fades.
    const MEMORY: u16 = 60;

    const fn new(ones: u16) -> Self {
        Self { ones, seen: Self::CONFIDENCE }
    }

    fn learn(&mut self, bit: bool) {
        // Within 1/64 .. 63/64 of certainty a surprise costs at most 6 bits.
        let goal = if bit { 65_535 - 512 } else { 512 };
        self.ones = (i32::from(self.ones) + (goal - i32::from(self.ones)) / i32::from(self.seen + 1)) as u16;
        self.seen = (self.seen + 1).min(Self::MEMORY);
    }
}

/// What is learned about one kind of number.
#[derive(Clone, Debug)]
pub(super) struct Model {
    /// "Has more binary digits", by how many digits lie beyond the expected magnitude.
    longer: [Bit; STEPS],
    /// The digit behind the leading one, likewise.
    second: [Bit; STEPS],
    sign: Bit,
}

/// Digits from 8 below the expected magnitude to 3 above it have their own statistics.
const STEPS: usize = 12;
/// Where the expected magnitude itself stands among them.
const EXPECTED: i32 = 8;
/// Most binary digits of a number.
const MAX_DIGITS: u32 = 44;

/// Chance in 1/65536 that a normal deviate which reaches 2^(r-1) standard deviations reaches 2^r, for r = -8..=3;
/// not below 1 %, since data are not normal.
const NORMAL: [u16; STEPS] =
    [65_400, 65_200, 65_000, 64_500, 63_800, 62_100, 58_400, 50_400, 33_700, 9_400, 1_000, 655];

impl Model {
    pub(super) fn new() -> Self {
        Self { longer: NORMAL.map(Bit::new), second: [Bit::new(1 << 15); STEPS], sign: Bit::new(1 << 15) }
    }
}

/// One direction of the coder. `value` is what to write, and ignored when reading; the answer is the value as the
/// reader will see it.
pub(super) trait Coder {
    /// Codes a bit whose chance of being set is `ones` / 65536.
    fn bit(&mut self, ones: u16, value: bool) -> Result<bool, RecordError>;

    /// Codes a whole number, expected to be of about 2^`magnitude`.
    fn number(&mut self, model: &mut Model, magnitude: i32, value: i64) -> Result<i64, RecordError> {
        let size = value.unsigned_abs();
        let digits = u64::BITS - size.leading_zeros();
        let step = |digit: u32| (digit as i32 - magnitude + EXPECTED).clamp(0, STEPS as i32 - 1) as usize;
        let mut count = 0;
        while self.learned(&mut model.longer[step(count)], digits > count)? {
            count += 1;
            if count > MAX_DIGITS {
                return Err(RecordError::Damaged { found: "a number of too many digits" });
            }
        }
        if count == 0 {
            return Ok(0);
        }
        let mut read = 1_u64;
        for digit in (0..count - 1).rev() {
            let set = size >> digit & 1 == 1;
            let set = if digit + 2 == count {
                self.learned(&mut model.second[step(count)], set)?
            } else {
                self.bit(1 << 15, set)?
            };
            read = read << 1 | u64::from(set);
        }
        let negative = self.learned(&mut model.sign, value < 0)?;
        Ok(if negative { -(read as i64) } else { read as i64 })
    }

    /// Codes a yes or no whose chance is learned in the sign of a model.
    fn flag(&mut self, model: &mut Model, value: bool) -> Result<bool, RecordError> {
        self.learned(&mut model.sign, value)
    }

    /// Codes a bit whose chance is learned.
    fn learned(&mut self, bit: &mut Bit, value: bool) -> Result<bool, RecordError> {
        let value = self.bit(bit.ones, value)?;
        bit.learn(value);
        Ok(value)
    }
}

/// The interval of both directions: what remains of [0, 2^64) after the bits so far; its settled leading bytes are
/// shifted out.
struct Interval {
    low: u64,
    high: u64,
}

impl Interval {
    const ALL: Self = Self { low: 0, high: u64::MAX };

    /// The last number of the part that stands for a one.
    fn split(&self, ones: u16) -> u64 {
        // `ones` is never 0, and the interval is far wider than 65536 except with a chance of 2^-40.
        self.low + ((u128::from(self.high - self.low) * u128::from(ones)) >> 16) as u64
    }

    fn take(&mut self, split: u64, bit: bool) {
        if bit {
            self.high = split;
        } else {
            self.low = split + 1;
        }
    }

    fn settled(&self) -> bool {
        (self.low ^ self.high) >> 56 == 0
    }

    fn shift(&mut self) {
        self.low <<= 8;
        self.high = self.high << 8 | 0xff;
    }
}

/// Writes.
pub(super) struct Writer {
    interval: Interval,
    bytes: Vec<u8>,
}

impl Writer {
    pub(super) fn new() -> Self {
        Self { interval: Interval::ALL, bytes: Vec::new() }
    }

    /// The bytes, as few as tell the interval apart when zeros follow.
    pub(super) fn finish(mut self) -> Vec<u8> {
        if self.interval.low > 0 {
            for kept in 1..=8 {
                let mask = u64::MAX.checked_shr(8 * kept).unwrap_or(0);
                let up = (self.interval.low | mask).wrapping_add(1);
                let value = if self.interval.low & mask == 0 { self.interval.low } else { up };
                if (self.interval.low..=self.interval.high).contains(&value) {
                    self.bytes.extend(&value.to_be_bytes()[..kept as usize]);
                    break;
                }
            }
        }
        self.bytes
    }
}

impl Coder for Writer {
    fn bit(&mut self, ones: u16, value: bool) -> Result<bool, RecordError> {
        self.interval.take(self.interval.split(ones), value);
        while self.interval.settled() {
            self.bytes.push((self.interval.low >> 56) as u8);
            self.interval.shift();
        }
        Ok(value)
    }
}

/// Reads.
pub(super) struct Reader<'a> {
    interval: Interval,
    at: u64,
    rest: std::slice::Iter<'a, u8>,
    /// Zeros taken from behind the end.
    beyond: u32,
}

impl<'a> Reader<'a> {
    /// Zeros that follow the last byte: the window reaches 8 bytes ahead.
    const BEYOND: u32 = 8;

    pub(super) fn new(bytes: &'a [u8]) -> Self {
        let mut reader = Self { interval: Interval::ALL, at: 0, rest: bytes.iter(), beyond: 0 };
        for _ in 0..8 {
            reader.next();
        }
        reader
    }

    fn next(&mut self) {
        let byte = self.rest.next().copied().unwrap_or_else(|| {
            self.beyond += 1;
            0
        });
        self.at = self.at << 8 | u64::from(byte);
    }
}

impl Coder for Reader<'_> {
    fn bit(&mut self, ones: u16, _: bool) -> Result<bool, RecordError> {
        let split = self.interval.split(ones);
        let bit = self.at <= split;
        self.interval.take(split, bit);
        while self.interval.settled() {
            self.interval.shift();
            self.next();
            if self.beyond > Self::BEYOND {
                return Err(RecordError::Damaged { found: "an early end" });
            }
        }
        Ok(bit)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn code<C: Coder>(coder: &mut C, numbers: &[(i64, i32)]) -> Result<Vec<i64>, RecordError> {
        let mut models = [Model::new(), Model::new()];
        numbers.iter().map(|(n, m)| coder.number(&mut models[(*m & 1) as usize], *m, *n)).collect()
    }

    proptest! {
        #[test]
        fn numbers_read_back(numbers in prop::collection::vec((-(1_i64 << 40)..1 << 40, -3..20_i32), 0..60)) {
            let mut writer = Writer::new();
            let written = code(&mut writer, &numbers).expect("fits");
            let bytes = writer.finish();
            prop_assert_eq!(&code(&mut Reader::new(&bytes), &numbers).expect("reads"), &written);
            prop_assert!(written.iter().copied().eq(numbers.iter().map(|n| n.0)));
        }

        #[test]
        fn any_bytes_end(bytes in prop::collection::vec(any::<u8>(), 0..80)) {
            let read = code(&mut Reader::new(&bytes), &[(0, 4); 4000]);
            prop_assert!(read.is_ok_and(|n| n.len() == 4000) || bytes.len() < 80);
        }
    }

    #[test]
    fn expected_numbers_cost_what_they_should() {
        // Normal deviates of 16 steps carry log2(16 sqrt(2 pi e)) = 6.05 bits each.
        let deviate = |i: u32| {
            (f64::from(i) * 0.754_877).fract()
                + (f64::from(i) * 0.569_840).fract()
                + (f64::from(i) * 0.819_172).fract()
                + (f64::from(i) * 0.671_043).fract()
                - 2.0
        };
        let numbers: Vec<(i64, i32)> =
            (0..4000).map(|i| ((deviate(i) * 16.0 * 3_f64.sqrt()).round() as i64, 4)).collect();
        let mut writer = Writer::new();
        code(&mut writer, &numbers).expect("fits");
        let bits = 8.0 * writer.finish().len() as f64 / 4000.0;
        assert!((5.9..6.35).contains(&bits), "{bits}");
        let mut writer = Writer::new();
        code(&mut writer, &[(0, 4); 4000]).expect("fits");
        let bits = 8.0 * writer.finish().len() as f64 / 4000.0;
        assert!(bits < 0.05, "{bits}");
    }
}
