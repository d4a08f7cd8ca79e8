/// More missing frames than this are a driver that began to count anew: ten minutes at 30 a second (a guess).
const MOST_MISSED: u32 = 18_000;

/// A camera's frame numbers over all its reopenings: they always rise, and what the driver missed is left out.
#[derive(Debug, Default)]
pub(super) struct Sequence {
    next: u64,
    count: Option<u32>,
}

impl Sequence {
    /// The number of a frame that the driver counts as `count`, and how many the driver missed before it.
    pub(super) fn number(&mut self, count: u32) -> (u64, u64) {
        let step = self.count.map_or(1, |before| count.wrapping_sub(before));
        // A driver that repeats itself or starts anew missed nothing that it could tell.
        let missed = if step == 0 || step > MOST_MISSED { 0 } else { u64::from(step - 1) };
        let number = self.next + missed;
        (self.next, self.count) = (number + 1, Some(count));
        (number, missed)
    }

    /// Above the last number given.
    pub(super) fn next(&self) -> u64 {
        self.next
    }

    /// The driver's count means nothing any more.
    pub(super) fn reopened(&mut self) {
        self.count = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_rise_through_gaps_wraps_repeats_and_reopenings() {
        let mut sequence = Sequence::default();
        let counts = [7, 8, 11, u32::MAX, 0, 2, 2, 0];
        let found = counts.map(|count| sequence.number(count));
        assert_eq!(found, [(0, 0), (1, 0), (4, 2), (5, 0), (6, 0), (8, 1), (9, 0), (10, 0)]);
        sequence.reopened();
        assert_eq!(sequence.number(90), (11, 0));
    }
}
