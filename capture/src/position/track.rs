use std::collections::VecDeque;

use super::Fix;

/// Time without a fix that is bridged, nanoseconds: one missing fix of a receiver that gives one a second, and a little.
pub(super) const BRIDGED_NS: u64 = 2_500_000_000;

/// The fixes of one boot, in their order.
#[derive(Debug, Default)]
pub(super) struct Track {
    fixes: VecDeque<Fix>,
    /// Metres driven up to the last fix.
    driven: f64,
}

impl Track {
    /// Takes the next fix; `false`, and the fix is left out, when it is older than the last. Beyond `most` the oldest is
    /// forgotten.
    pub(super) fn push(&mut self, fix: Fix, most: usize) -> bool {
        if let Some(last) = self.fixes.back() {
            if fix.t_mono_ns < last.t_mono_ns {
                return false;
            }
            self.driven = self.driven(fix.t_mono_ns).unwrap_or(self.driven);
        }
        self.fixes.push_back(fix);
        if self.fixes.len() > most {
            self.fixes.pop_front();
        }
        true
    }

    pub(super) fn last(&self) -> Option<&Fix> {
        self.fixes.back()
    }

    /// The last fixes, so many, the oldest first.
    pub(super) fn newest(&self, count: usize) -> Vec<Fix> {
        self.fixes.iter().skip(self.fixes.len().saturating_sub(count)).cloned().collect()
    }

    /// The position at a moment between two fixes that are not too far apart.
    pub(super) fn at(&self, t_mono_ns: u64) -> Option<Fix> {
        let later = self.fixes.partition_point(|fix| fix.t_mono_ns < t_mono_ns);
        let after = self.fixes.get(later)?;
        if after.t_mono_ns == t_mono_ns {
            return Some(after.clone());
        }
        let before = self.fixes.get(later.checked_sub(1)?)?;
        (after.t_mono_ns - before.t_mono_ns <= BRIDGED_NS).then(|| before.between(after, t_mono_ns))
    }

    /// Speed over ground by the last fix, metres a second, where that is not too long ago.
    pub(super) fn speed(&self, t_mono_ns: u64) -> Option<f64> {
        let last = self.last()?;
        last.speed_m_per_s.filter(|_| t_mono_ns.abs_diff(last.t_mono_ns) <= BRIDGED_NS)
    }

    /// Metres driven since the first fix, at the speed of each: frames cannot wait for the next fix.
    pub(super) fn driven(&self, t_mono_ns: u64) -> Option<f64> {
        let last = self.last()?.t_mono_ns;
        let seconds = if t_mono_ns < last { -((last - t_mono_ns) as f64) } else { (t_mono_ns - last) as f64 } * 1e-9;
        Some(self.driven + self.speed(t_mono_ns)? * seconds)
    }
}
