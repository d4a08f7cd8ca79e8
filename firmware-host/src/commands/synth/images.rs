use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, sync_channel};

use demeter_frame::Pinhole;
use demeter_recon::world::{View, boundary_distance, training_view};
use indicatif::{ProgressBar, ProgressStyle};

use crate::error::{CommandError, Exit};
use crate::output::Output;

use super::assets;

/// Arguments of `demeter synth images`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// How many pictures.
    #[arg(long, default_value_t = 16, value_parser = clap::value_parser!(u32).range(1..=10_000_000))]
    count: u32,
    /// Width and height, pixels.
    #[arg(long, default_value_t = 256, value_parser = clap::value_parser!(u32).range(16..=2048))]
    size: u32,
    /// Picture i of seed S is the same whatever the count.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Threads; the files do not depend on it.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=64))]
    threads: u32,
    /// A folder of tools/helios/meshes.py, whose plants and leaf pictures join those of our own species.
    #[arg(long, value_name = "FOLDER")]
    assets: Option<PathBuf>,
    /// The folder: meta.json, rgb.u8 [n,h,w,3], sem.u8, dist.u8, depth.u16 [n,h,w], camera.f32 [n,3] (horizontal field of
    /// view, pitch, roll, radians), little-endian.
    #[arg(short, long)]
    output: PathBuf,
}

/// Depth that codes 1 and 65535 stand for, metres.
const DEPTH_RANGE: (f32, f32) = (0.05, 50.0);

/// A picture as the training files keep it.
struct Sheet {
    rgb: Vec<u8>,
    sem: Vec<u8>,
    dist: Vec<u8>,
    depth: Vec<u8>,
    camera: Vec<u8>,
}

pub(super) fn run(args: &Args, output: &Output) -> Result<Exit, CommandError> {
    let made = args.assets.as_deref().map(assets::made).transpose()?;
    let nursery = assets::nursery(args.assets.as_deref())?;
    let failed = |error: std::io::Error| {
        CommandError::failed("output", &std::io::Error::other(format!("{}: {error}", args.output.display())))
    };
    let mut files = Files::create(&args.output).map_err(failed)?;
    let bar = ProgressBar::new(u64::from(args.count));
    bar.set_style(ProgressStyle::with_template("{bar:40} {pos}/{len} {per_sec} {eta}").unwrap_or(bar.style()));
    std::thread::scope(|scope| {
        // Thread k makes pictures k, k + threads, ..; reading the channels in turn restores the order.
        let make = |k: u32| {
            let (send, receive) = sync_channel(4);
            let nursery = &nursery;
            scope.spawn(move || {
                for i in (k..args.count).step_by(args.threads as usize) {
                    // Seeds of one set never meet those of another with a nearby seed.
                    let seed = args.seed.wrapping_mul(0x9E37_79B9_7F4A_7C15).wrapping_add(u64::from(i));
                    let made = training_view(nursery, args.size, seed).map(|shot| Sheet::of(&shot));
                    if send.send(made).is_err() {
                        return;
                    }
                }
            });
            receive
        };
        let sheets: Vec<Receiver<_>> = (0..args.threads).map(make).collect();
        for i in 0..args.count {
            let made = sheets[(i % args.threads) as usize].recv();
            let sheet = made
                .map_err(|error| CommandError::failed("world", &error))?
                .map_err(|error| CommandError::failed("world", &error))?;
            files.write(&sheet).map_err(failed)?;
            bar.inc(1);
        }
        Ok::<(), CommandError>(())
    })?;
    bar.finish();
    let meta = serde_json::json!({
        "assets": made,
        "count": args.count, "height": args.size, "width": args.size, "seed": args.seed,
        "camera": "camera.f32 [n,3]: horizontal field of view; pitch, the optical axis above the horizon, negative when \
            the camera looks down; roll, by how much the world's up leans to the right of the picture's; radians",
        "program": concat!("demeter ", env!("CARGO_PKG_VERSION")),
    });
    // Written last: a folder with meta.json is complete.
    files.finish(&args.output, &meta.to_string()).map_err(failed)?;
    if output.json {
        output.json(&meta)?;
    }
    Ok(Exit::Done)
}

struct Files([BufWriter<File>; 5]);

impl Files {
    fn create(folder: &Path) -> std::io::Result<Self> {
        std::fs::create_dir_all(folder)?;
        let file = |name| File::create(folder.join(name)).map(BufWriter::new);
        Ok(Self([file("rgb.u8")?, file("sem.u8")?, file("dist.u8")?, file("depth.u16")?, file("camera.f32")?]))
    }

    fn write(&mut self, sheet: &Sheet) -> std::io::Result<()> {
        let parts = [&sheet.rgb, &sheet.sem, &sheet.dist, &sheet.depth, &sheet.camera];
        self.0.iter_mut().zip(parts).try_for_each(|(file, part)| file.write_all(part))
    }

    fn finish(mut self, folder: &Path, meta: &str) -> std::io::Result<()> {
        self.0.iter_mut().try_for_each(Write::flush)?;
        std::fs::write(folder.join("meta.json"), meta)
    }
}

impl Sheet {
    fn of((view, camera): &(View, Pinhole)) -> Self {
        let tilt = camera.tilt();
        let seen = [camera.intrinsics.hfov(), tilt.pitch, tilt.roll];
        let dist = boundary_distance(&view.instances);
        Self {
            rgb: view.rgb.as_raw().clone(),
            sem: view.semantic.as_raw().clone(),
            dist: dist.as_raw().iter().map(|t| (t * 255.0).round() as u8).collect(),
            depth: view.depth.as_raw().iter().flat_map(|z| depth_code(*z).to_le_bytes()).collect(),
            camera: seen.iter().flat_map(|x| (*x as f32).to_le_bytes()).collect(),
        }
    }
}

/// 0 = none, else 1 + 65534 (ln z - ln near) / (ln far - ln near).
fn depth_code(z: f32) -> u16 {
    if z.is_nan() || z <= 0.0 {
        return 0;
    }
    let (near, far) = DEPTH_RANGE;
    let share = (z.clamp(near, far).ln() - near.ln()) / (far.ln() - near.ln());
    (1.0 + 65534.0 * share).round() as u16
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn depth_codes_cover_their_range_and_none_stays_none() {
        assert_eq!([0.0, f32::NAN, -1.0].map(depth_code), [0; 3]);
        assert_eq!([0.01, 0.05, 50.0, 80.0].map(depth_code), [1, 1, 65535, 65535]);
    }
}
