use std::path::PathBuf;

use demeter_recon::cloud::PointOrgan;
use demeter_recon::export::cloud_to_ply;
use demeter_recon::world::{grow, labelled_cloud, seeded};

use super::unit_interval;
use crate::error::{CommandError, Exit};
use crate::files;
use crate::output::Output;

/// Arguments of `demeter synth clouds`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// soybean, maize or another species that ships.
    #[arg(long, default_value = "soybean")]
    species: String,
    /// How many clouds, of ages spread evenly up to --age.
    #[arg(long, default_value_t = 8, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    count: u32,
    /// Points a cloud.
    #[arg(long, default_value_t = 20_000, value_parser = clap::value_parser!(u32).range(1..=10_000_000))]
    points: u32,
    /// Age of the oldest plant: 0 = the first true leaf, 1 = full height.
    #[arg(long, default_value_t = 1.0, value_parser = unit_interval)]
    age: f64,
    /// Standard deviation of the points' noise, millimetres.
    #[arg(long, default_value_t = 0.5, value_parser = millimetres)]
    noise: f64,
    /// The same seed gives the same bytes.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// The folder: NNNN.ply with x y z in metres, label (0 = stems, 1.. one a blade), organ and kind.
    #[arg(short, long)]
    output: PathBuf,
}

pub(super) fn run(args: &Args, output: &Output) -> Result<Exit, CommandError> {
    let species = files::species(&args.species)?;
    std::fs::create_dir_all(&args.output).map_err(|error| files::file_error(&args.output, &error))?;
    for i in 0..args.count {
        let mut rng = seeded(args.seed.wrapping_mul(0x9E37_79B9_7F4A_7C15).wrapping_add(u64::from(i)));
        let age = args.age * (f64::from(i) + 1.0) / f64::from(args.count);
        let plant = grow(&species, age, &mut rng);
        let mut made = labelled_cloud(&plant, &species, args.points as usize, args.noise * 1e-3, &mut rng)
            .map_err(|error| CommandError::failed("world", &error))?;
        let organ = |organ: &u32| PointOrgan { organ: *organ as i32, kind: plant.organs[*organ as usize].kind() };
        made.cloud.organs = Some(made.organ.iter().map(organ).collect());
        files::write(&args.output.join(format!("{i:04}.ply")), &cloud_to_ply(&made.cloud))?;
    }
    if output.json {
        output.json(&serde_json::json!({"clouds": args.count}))?;
    }
    Ok(Exit::Done)
}

fn millimetres(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(x) if (0.0..=100.0).contains(&x) => Ok(x),
        _ => Err("expected millimetres from 0 to 100".into()),
    }
}
