//! What is told of learned contours: rejected scans, and errors on scans that were left out.

use std::fmt::Write;
use std::path::PathBuf;

use demeter_recon::learn::shape::GridKind;
use serde::Serialize;

/// The answer of `demeter learn shape --json`.
#[derive(Debug, Serialize)]
pub(super) struct Told {
    pub(super) species: String,
    pub(super) hash: String,
    pub(super) output: PathBuf,
    pub(super) grid: GridKind,
    pub(super) scans: usize,
    pub(super) kept: usize,
    pub(super) rejected: Vec<Rejected>,
    pub(super) curve: Vec<Row>,
}

/// A scan that was not learned from.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Rejected {
    pub(super) file: String,
    pub(super) reason: String,
}

/// What a number of components is worth; errors in leaf lengths, none where no scan could be left out.
#[derive(Debug, Serialize)]
pub(super) struct Row {
    components: usize,
    /// Share of the variance that they explain.
    explained: f64,
    /// Mean contour error of left-out scans.
    error: Option<f64>,
    /// The error that one in twenty exceeds.
    error_p95: Option<f64>,
    /// The mean when the rejected scans are kept.
    error_all: Option<f64>,
}

/// The table's rows from the variance that each component explains and from the errors `[components + 1][scans]` with and
/// without rejecting.
pub(super) fn curve(explained: &[f64], kept: &[Vec<f64>], all: &[Vec<f64>]) -> Vec<Row> {
    let mean = |errors: &Vec<f64>| errors.iter().sum::<f64>() / errors.len() as f64;
    let p95 = |errors: &Vec<f64>| {
        let mut sorted = errors.clone();
        sorted.sort_by(f64::total_cmp);
        sorted[(sorted.len() * 19 / 20).min(sorted.len() - 1)]
    };
    let row = |components: usize| Row {
        components,
        explained: explained[..components].iter().fold(0.0, |sum, share| sum + share),
        error: kept.get(components).map(mean),
        error_p95: kept.get(components).map(p95),
        error_all: all.get(components).map(mean),
    };
    (0..=explained.len()).map(row).collect()
}

impl Told {
    /// The answer as text.
    pub(super) fn table(&self) -> String {
        let mut text = String::new();
        for Rejected { file, reason } in &self.rejected {
            // Writing to a String cannot fail, here and below.
            writeln!(text, "rejected {file}: {reason}").unwrap_or_default();
        }
        let grid = match self.grid {
            GridKind::Oval => "oval",
            GridKind::Harmonic => "harmonic",
        };
        writeln!(text, "{} of {} scans kept, {grid} grids -> {}", self.kept, self.scans, self.output.display())
            .unwrap_or_default();
        let percent = |error: Option<f64>| error.map_or("-".to_owned(), |error| format!("{:.3}", 100.0 * error));
        writeln!(text, "Mean contour error of left-out scans, % of leaf length:").unwrap_or_default();
        writeln!(
            text,
            "{:>10} {:>11} {:>8} {:>8} {:>18}",
            "components", "explained %", "mean", "p95", "rejected ones kept"
        )
        .unwrap_or_default();
        for row in &self.curve {
            let [mean, p95, all] = [row.error, row.error_p95, row.error_all].map(percent);
            writeln!(text, "{:>10} {:>11.2} {mean:>8} {p95:>8} {all:>18}", row.components, 100.0 * row.explained)
                .unwrap_or_default();
        }
        text
    }
}
