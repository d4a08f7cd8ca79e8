//! Robust losses.

/// What one miss weighs and costs.
#[derive(Clone, Copy)]
pub(super) struct Loss {
    pub weight: f64,
    pub cost: f64,
}

impl Loss {
    /// Squared up to `sigma`, linear beyond (Huber); costs are in units of σ².
    pub(super) fn huber(miss: f64, sigma: f64) -> Self {
        let r = miss.abs() / sigma;
        if r <= 1.0 {
            Self { weight: 1.0 / (sigma * sigma), cost: r * r }
        } else {
            Self { weight: 1.0 / (r * sigma * sigma), cost: 2.0 * r - 1.0 }
        }
    }

    /// Squared near 0, never more than `most` (Geman-McClure): for misses that may be no fault of the surface's.
    pub(super) fn bounded(miss: f64, sigma: f64, most: f64) -> Self {
        let r2 = (miss / sigma).powi(2);
        let share = most / (most + r2);
        Self { weight: share * share / (sigma * sigma), cost: r2 * share }
    }

    pub(super) fn times(self, share: f64) -> Self {
        Self { weight: self.weight * share, cost: self.cost * share }
    }
}
