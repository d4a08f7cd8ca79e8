use std::num::NonZeroUsize;
use std::path::PathBuf;

use demeter_frame::Semantic;
use demeter_models::{Candidate, Layout, Runtime, find_manifest};
use serde::Deserialize;
use serde::de::IntoDeserializer;
use serde::de::value::Error;

use super::failed;
use super::list::Row;
use super::probe::Probe;
use crate::config::OURS;
use crate::error::{CommandError, Exit};
use crate::eye::EyeError;
use crate::output::Output;

/// Arguments of `demeter models install`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// The ONNX file.
    file: PathBuf,
    /// What it will be called; without it as the file is.
    #[arg(long)]
    name: Option<String>,
    /// Its layout, where names and shapes do not tell it.
    #[arg(long)]
    layout: Option<Layout>,
    /// The organ of each of a detector's classes from number 0 on, as `background,leaf,stem,main_stem`.
    #[arg(long, value_delimiter = ',', value_parser = organ)]
    classes: Vec<Semantic>,
    /// Where it comes from and on what terms, for people.
    #[arg(long)]
    source: Option<String>,
    /// The folder of models; without it that of our own.
    #[arg(long)]
    folder: Option<PathBuf>,
    /// Put it in the place of another of its name.
    #[arg(long)]
    replace: bool,
}

fn organ(name: &str) -> Result<Semantic, Error> {
    Semantic::deserialize(name.into_deserializer())
}

pub(super) fn run(args: &Args, output: &Output) -> Result<Exit, CommandError> {
    let runtime = Runtime::load(None).map_err(EyeError::from)?;
    let mut candidate = Candidate::examine(&runtime, &args.file, args.layout).map_err(|error| failed(&error))?;
    let manifest = &mut candidate.manifest;
    if let Some(name) = &args.name {
        manifest.name.clone_from(name);
    }
    if !args.classes.is_empty() {
        manifest.classes.clone_from(&args.classes);
    }
    if args.source.is_some() {
        manifest.source.clone_from(&args.source);
    }
    // It must run before anything here changes.
    let trial = tempfile::tempdir().map_err(|error| CommandError::failed("file", &error))?;
    candidate
        .install(trial.path(), false)
        .and_then(|path| Probe::open(&runtime, &path, NonZeroUsize::MIN)?.run())
        .map_err(|error| failed(&error))?;
    let folder = match &args.folder {
        Some(folder) => folder.clone(),
        None => find_manifest(OURS).map_err(|error| failed(&error))?.with_file_name(""),
    };
    let path = candidate.install(&folder, args.replace).map_err(|error| failed(&error))?;
    if output.json {
        let row = Row::read(&path).map_err(|error| failed(&error))?;
        output.json(&serde_json::json!({"models": [row]}))?;
    } else {
        output.text(&format!("{}: {}\n", path.display(), candidate.manifest.layout))?;
    }
    Ok(Exit::Done)
}
