//! What the blades of one plant have in common.

use super::LeafFit;
use crate::statistics::{mean, median};

/// Fewest points inside its edges that tell a blade's density, and fewest blades that tell the crowd's (guesses).
const INNER_POINTS: f64 = 30.0;
const BLADES: usize = 3;

/// How a plant's blades were sampled.
#[derive(Clone, Copy, Debug)]
pub(in crate::fit) struct Crowd {
    /// Mean over the blades of the logarithm of points per square metre, holes counted in.
    pub log_density: f64,
    /// Its standard deviation from blade to blade.
    pub spread: f64,
    /// Standard deviation of the points about their surface, metres.
    pub noise: f64,
}

impl Crowd {
    /// From blades, each with how many points of its cloud stand for one of the fit's; `None` when too few can tell.
    pub(in crate::fit) fn of(fits: &[(&LeafFit, f64)]) -> Option<Self> {
        let told = || fits.iter().filter(|(fit, _)| fit.inner.points >= INNER_POINTS);
        if told().count() < BLADES {
            return None;
        }
        let logs = || told().map(|(fit, each)| (fit.inner.density() * each).ln());
        let log_density = mean(logs())?;
        Some(Self {
            log_density,
            spread: mean(logs().map(|log| (log - log_density).powi(2)))?.sqrt(),
            noise: median(told().map(|(fit, _)| fit.noise))?,
        })
    }
}
