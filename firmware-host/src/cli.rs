//! The command line (spec/appliance.md "Command line"): one line here and one in `run` a command, the rest in
//! [`crate::commands`].

use std::process::ExitCode;

use clap::{Parser, Subcommand};
use tracing_subscriber::EnvFilter;

use crate::commands::{
    camera, compact, decode, doctor, edit, eval, fit, import, learn, models, photo, plants, replay, run, species, sync,
    synth,
};
use crate::error::{CommandError, Exit};
use crate::output::Output;

/// Turns camera frames of crop rows into 3D plants.
#[derive(Parser)]
#[command(name = "demeter", version)]
struct Cli {
    /// Answer with JSON on standard output.
    #[arg(long, global = true)]
    json: bool,
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// List cameras, look through one, record them, calibrate them.
    Camera(camera::Args),
    /// Turn a record back into its plant.
    Decode(decode::Args),
    /// Measure the method: tables of figures beside their goals.
    Eval(eval::Args),
    /// Fit a point cloud.
    Fit(fit::Args),
    /// Learn a species from scans.
    Learn(learn::Args),
    /// Change a plant: move coefficients, bend stems, cut, graft, go towards another plant.
    Edit(edit::Args),
    /// Read a plant of the authors' Demeter release.
    Import(import::Args),
    /// List, show, export and import species.
    Species(species::Args),
    /// List, install, verify and time the networks.
    Models(models::Args),
    /// Check this box: store, models, ONNX Runtime, disk, and how to mend what is missing.
    Doctor(doctor::Args),
    /// Reconstruct the plants of a photo.
    Photo(photo::Args),
    /// Run a recorded session into a store.
    Replay(replay::Args),
    /// Make synthetic plants, sessions, clouds and training pictures, with their truth.
    Synth(synth::Args),
    /// List, show and export the plants of a store.
    Plants(plants::Args),
    /// Send what waits to the server or disk of the configuration, or tell what waits and why.
    Sync(sync::Args),
    /// Merge the daily files of past months where the plants went, so that there are few to query.
    Compact(compact::Args),
    /// Run the daemon: the page, the API and the configured source of frames.
    Run(run::Args),
}

impl Command {
    fn run(&self, output: &Output) -> Result<Exit, CommandError> {
        match self {
            Self::Camera(args) => camera::run(args, output),
            Self::Decode(args) => decode::run(args, output),
            Self::Eval(args) => eval::run(args, output),
            Self::Fit(args) => fit::run(args, output),
            Self::Learn(args) => learn::run(args, output),
            Self::Edit(args) => edit::run(args, output),
            Self::Import(args) => import::run(args, output),
            Self::Species(args) => species::run(args, output),
            Self::Models(args) => models::run(args, output),
            Self::Doctor(args) => doctor::run(args, output),
            Self::Photo(args) => photo::run(args, output),
            Self::Replay(args) => replay::run(args, output),
            Self::Synth(args) => synth::run(args, output),
            Self::Plants(args) => plants::run(args, output),
            Self::Sync(args) => sync::run(args, output),
            Self::Compact(args) => compact::run(args, output),
            Self::Run(args) => run::run(args, output),
        }
    }
}

/// Runs the program: parses the arguments, runs the command, reports its error.
#[must_use]
pub fn main() -> ExitCode {
    // Progress and logs go to standard error; RUST_LOG chooses how much.
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new("warn,demeter=info"));
    tracing_subscriber::fmt().with_writer(std::io::stderr).with_env_filter(filter).with_target(false).init();
    let result = match Cli::try_parse() {
        Ok(cli) => {
            let output = Output::new(cli.json);
            cli.command.run(&output).map_err(|error| (output, error))
        }
        // Help and version are no errors: clap prints them and they end with 0.
        Err(help) if !help.use_stderr() => {
            return if help.print().is_ok() { Exit::Done } else { Exit::Failed }.into();
        }
        Err(wrong) => {
            let output = Output::new(std::env::args_os().any(|a| a == "--json"));
            Err((output, CommandError::usage("usage", wrong.render())))
        }
    };
    match result {
        Ok(exit) => exit,
        Err((output, error)) => {
            output.error(&error);
            error.exit
        }
    }
    .into()
}
