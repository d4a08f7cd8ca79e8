//! `demeter doctor`: what works on this box and how to mend what does not.

use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

use demeter_models::Runtime;
use serde::Serialize;

use crate::config::{Config, ModelsConfig, PositionConfig};
use crate::daemon::disk::{folder_of, space};
use crate::error::{CommandError, Exit, chain};
use crate::eye::Eye;
use crate::files;
use crate::output::Output;
use crate::store::{Reader, StoreError};

mod lenses;
mod position;

/// Free bytes below which the disk is said to be full: a guess at a day of plants with their pictures.
const MIN_FREE: u64 = 1 << 30;

/// Arguments of `demeter doctor`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The configuration that `demeter run` would be given.
    #[arg(long)]
    config: Option<PathBuf>,
    /// The store, instead of the configuration's.
    #[arg(long)]
    db: Option<PathBuf>,
}

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

impl Check {
    fn new(name: &'static str, result: Result<String, Trouble>) -> Self {
        match result {
            Ok(found) => Self { name, ok: true, found, mend: None },
            Err(Trouble { found, mend }) => Self { name, ok: false, found, mend: Some(mend) },
        }
    }
}

/// What does not work, and how to mend it.
struct Trouble {
    found: String,
    mend: String,
}

impl Trouble {
    fn new(error: &dyn std::error::Error, mend: &str) -> Self {
        Self { found: chain(error), mend: mend.into() }
    }
}

/// Looks at everything and prints one line each.
///
/// # Errors
/// [`CommandError`] when the answer cannot be written. What does not work is in the answer and ends with exit 1.
pub fn run(args: &Args, output: &Output) -> Result<Exit, CommandError> {
    let config = Config::load(args.config.as_deref());
    let store = args.db.clone().or(config.as_ref().ok().map(|config| config.store.path.clone()));
    let models = config.as_ref().map_or_else(|_| ModelsConfig::default(), |config| config.models.clone());
    let receiver = config.as_ref().map_or_else(|_| PositionConfig::default(), |config| config.position.clone());
    let cameras = config.as_ref().map_or_else(|_| Vec::new(), |config| config.cameras.clone());
    let config =
        config.map_err(|error| Trouble::new(&error, "correct the line, or remove it: every key has a default"));
    let mut checks = vec![Check::new("configuration", config.map(|config| format!("page on {}", config.api.listen)))];
    if let Some(path) = store {
        checks.push(Check::new("store", check_store(&path)));
        checks.push(Check::new("disk", check_disk(&path)));
    }
    let runtime = Runtime::load(None);
    let networks = runtime.as_ref().ok().map(|_| Check::new("networks", check_networks(&models)));
    let library = runtime.map(|runtime| format!("{}, {}", runtime.library().display(), runtime.build_info()));
    let mend = "run tools/fetch-onnxruntime.sh, or point DEMETER_ONNXRUNTIME to libonnxruntime.so";
    checks.push(Check::new("ONNX Runtime", library.map_err(|error| Trouble::new(&error, mend))));
    checks.extend(networks);
    checks.push(Check::new("species", check_species()));
    if !cameras.is_empty() {
        checks.push(Check::new("lenses", lenses::check(&cameras)));
    }
    checks.push(Check::new("position", position::check(&receiver)));

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

fn check_store(path: &Path) -> Result<String, Trouble> {
    let at = path.display();
    match Reader::open(path).and_then(|reader| reader.summary()) {
        Ok(summary) => Ok(format!("{at}: {} plants, {} not sent yet", summary.plants, summary.unsent)),
        Err(StoreError::Missing { .. }) => Ok(format!("{at}: not there yet, the first run makes it")),
        Err(error @ StoreError::NewerSchema { .. }) => {
            Err(Trouble::new(&error, "install the newer program again, or name another file with --db"))
        }
        Err(error @ StoreError::NotAStore { .. }) => {
            Err(Trouble::new(&error, "move the file away, or name another with --db"))
        }
        Err(error) => Err(Trouble::new(&error, "see that this user may read and write the file and its folder")),
    }
}

fn check_disk(store: &Path) -> Result<String, Trouble> {
    let folder = folder_of(store);
    let name = folder.display();
    let free = space(folder)
        .map_err(|error| Trouble { found: format!("{name}: {error}"), mend: "make the folder".into() })?
        .free;
    let found = format!("{name}: {:.1} GB free", free as f64 / 1e9);
    if free < MIN_FREE { Err(Trouble { found, mend: "free at least 1 GiB".into() }) } else { Ok(found) }
}

/// Ours and those that `[models]` names. Opening one verifies its file's hash, its inputs and its outputs.
fn check_networks(config: &ModelsConfig) -> Result<String, Trouble> {
    let mend = "install the models folder beside the program, or point DEMETER_MODELS to it";
    let eye = Eye::of_photos(config, NonZeroUsize::MIN).map_err(|error| Trouble::new(&error, mend))?;
    if let Some(degraded) = eye.degraded().first() {
        let mend = "`demeter models list` shows what is installed, `demeter models install` takes a file in";
        return Err(Trouble { found: degraded.to_string(), mend: mend.into() });
    }
    Ok(eye.models().into_iter().map(|(name, _)| name).collect::<Vec<_>>().join(", "))
}

fn check_species() -> Result<String, Trouble> {
    for name in demeter_recon::species::NAMES {
        files::species(name)
            .map_err(|error| Trouble::new(&error, "install the program again: its species are part of it"))?;
    }
    Ok(demeter_recon::species::NAMES.join(", "))
}
