use std::num::NonZeroUsize;
use std::path::Path;

use demeter_models::{ModelError, Runtime};
use serde::Serialize;

use super::probe::Probe;
use crate::error::{CommandError, Exit, chain};
use crate::eye::EyeError;
use crate::output::Output;

/// Arguments of `demeter models verify`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// The models; all when none is named.
    names: Vec<String>,
}

#[derive(Serialize)]
struct Verdict {
    name: String,
    ok: bool,
    #[serde(skip_serializing_if = "Option::is_none")]
    why: Option<String>,
}

pub(super) fn run(args: &Args, output: &Output) -> Result<Exit, CommandError> {
    let runtime = Runtime::load(None).map_err(EyeError::from)?;
    let verdict = |path: &Path| {
        let why = verify(&runtime, path).err().map(|error| chain(&error));
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        Verdict { name, ok: why.is_none(), why }
    };
    let verdicts: Vec<Verdict> = super::manifests(&args.names)?.iter().map(|path| verdict(path)).collect();
    if output.json {
        output.json(&serde_json::json!({"models": verdicts}))?;
    } else {
        for Verdict { name, why, .. } in &verdicts {
            let line = why.as_ref().map_or_else(|| format!("ok    {name}\n"), |why| format!("FAIL  {name}: {why}\n"));
            output.text(&line)?;
        }
    }
    Ok(if verdicts.iter().all(|verdict| verdict.ok) { Exit::Done } else { Exit::Failed })
}

/// The file is that of its manifest, opens, and gives finite numbers.
fn verify(runtime: &Runtime, path: &Path) -> Result<(), ModelError> {
    Probe::open(runtime, path, NonZeroUsize::MIN)?.run()
}
