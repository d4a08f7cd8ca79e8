use std::path::{Path, PathBuf};

use demeter_capture::{Recorder, Source};
use demeter_frame::Intrinsics;
use demeter_recon::world::{PlantTruth, Row, truth};
use indicatif::ProgressBar;
use serde::Serialize;

use super::unit_interval;
use crate::commands::spacing;
use crate::error::{CommandError, Exit};
use crate::files;
use crate::output::Output;
use crate::synthetic::Synthetic;

/// Arguments of `demeter synth session`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// soybean, maize or another species that ships.
    #[arg(long, default_value = "soybean")]
    species: String,
    /// Plants in the row.
    #[arg(long, default_value_t = 6, value_parser = clap::value_parser!(u16).range(1..=500))]
    plants: u16,
    /// Metres from plant to plant.
    #[arg(long, default_value_t = 0.35, value_parser = spacing)]
    spacing: f64,
    /// 0 = the first true leaf, 1 = full height.
    #[arg(long, default_value_t = 0.25, value_parser = unit_interval)]
    age: f64,
    /// Pictures, evenly along the row.
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u16).range(1..=10_000))]
    frames: u16,
    /// Width of the pictures, pixels; the height is three quarters of it.
    #[arg(long, default_value_t = 640, value_parser = clap::value_parser!(u32).range(64..=4096))]
    width: u32,
    /// Horizontal field of view, degrees.
    #[arg(long, default_value_t = 42.0, value_parser = degrees)]
    hfov: f64,
    /// The same seed gives the same bytes.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// The session's folder; it must not hold a session yet.
    #[arg(short, long)]
    output: PathBuf,
}

/// truth.json beside session.toml.
#[derive(Serialize)]
struct Truth {
    program: &'static str,
    seed: u64,
    plants: Vec<PlantTruth>,
}

pub(super) fn run(args: &Args, output: &Output) -> Result<Exit, CommandError> {
    let species = files::species(&args.species)?;
    let (width, height) = (args.width, args.width * 3 / 4);
    let intrinsics = Intrinsics::from_hfov(width, height, args.hfov.to_radians());
    let plan = Row { plants: args.plants.into(), spacing: args.spacing, age: args.age, frames: args.frames.into() };
    let session_id = format!("synth-{}-{}", args.species, args.seed);
    let mut rig = Synthetic::new(&species, &plan, intrinsics, args.seed, session_id)
        .map_err(|error| CommandError::failed("world", &error))?;
    let manifest = rig.manifest(&args.species, &plan);
    let failed = |error: &dyn std::error::Error| CommandError::failed("session", error);
    let mut recorder = Recorder::create(&args.output, manifest).map_err(|error| failed(&error))?;
    let bar = ProgressBar::new(args.frames.into());
    while let Some(frame) = rig.next().map_err(|error| failed(&error))? {
        recorder.write(&frame).map_err(|error| failed(&error))?;
        bar.inc(1);
    }
    bar.finish_and_clear();
    recorder.finish().map_err(|error| failed(&error))?;
    let plants = truth(&rig.scene, |_| Some(&species)).map_err(|error| failed(&error))?;
    let truth = Truth { program: concat!("demeter ", env!("CARGO_PKG_VERSION")), seed: args.seed, plants };
    write_truth(&args.output, &truth)?;
    if output.json {
        output.json(&truth)?;
    }
    Ok(Exit::Done)
}

fn write_truth(folder: &Path, truth: &Truth) -> Result<(), CommandError> {
    let text = serde_json::to_string_pretty(truth).map_err(|error| CommandError::failed("output", &error))?;
    files::write(&folder.join("truth.json"), text.as_bytes())
}

fn degrees(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(x) if (10.0..=120.0).contains(&x) => Ok(x),
        _ => Err("expected degrees from 10 to 120".into()),
    }
}
