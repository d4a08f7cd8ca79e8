//! `demeter doctor`: what works on this box and how to mend what does not.

use serde::Serialize;

use crate::error::{CommandError, Exit};
use crate::output::Output;

/// Arguments of `demeter doctor`.
#[derive(Debug, clap::Args)]
pub struct Args {}

/// One thing looked at.
#[derive(Debug, Serialize)]
struct Check {
    /// What was looked at.
    name: &'static str,
    /// It works.
    ok: bool,
    /// What was found.
    found: String,
    /// What to do about it, when it does not work.
    #[serde(skip_serializing_if = "Option::is_none")]
    mend: Option<String>,
}

/// Looks at everything and prints one line each.
///
/// # Errors
/// [`CommandError`] when the answer cannot be written. What does not work is in the answer and ends with exit 1.
pub fn run(_args: &Args, output: &Output) -> Result<Exit, CommandError> {
    let checks = [species()];
    if output.json {
        output.json(&serde_json::json!({"checks": checks}))?;
    } else {
        for Check { name, ok, found, mend } in &checks {
            let word = if *ok { "ok  " } else { "FAIL" };
            output.text(&format!("{word}  {name}: {found}\n"))?;
            if let Some(mend) = mend {
                output.text(&format!("      to mend: {mend}\n"))?;
            }
        }
    }
    Ok(if checks.iter().all(|check| check.ok) { Exit::Done } else { Exit::Failed })
}

fn species() -> Check {
    let found = demeter_recon::species::NAMES.join(", ");
    Check { name: "species", ok: true, found, mend: None }
}
