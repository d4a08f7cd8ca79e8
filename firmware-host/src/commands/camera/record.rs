use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use demeter_capture::{
    CameraHealth, Cameras, ID, LensWatch, Positions, Receiver, Recorder, SessionError, Source, SourceError, decode,
    is_id,
};
use demeter_frame::{CameraId, Frame};
use indicatif::ProgressBar;
use serde::Serialize;

use super::pick::Pick;
use crate::commands::spacing;
use crate::config::camera::{Sown, manifest};
use crate::error::{CommandError, Exit, chain};
use crate::files;
use crate::output::Output;

/// Arguments of `demeter camera record`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    #[command(flatten)]
    pick: Pick,
    /// How fast the rig drives along the row, metres a second: each frame's pose follows from it. Negative when the row
    /// passes from left to right. Not needed where the configuration has a receiver in `[position]`, which measures it.
    #[arg(long, allow_negative_numbers = true, value_parser = speed)]
    speed: Option<f64>,
    /// The crop.
    #[arg(long, default_value = "soybean")]
    species: String,
    /// Metres from plant to plant as sown: what is seen much nearer belongs to the same plant.
    #[arg(long, value_parser = spacing)]
    spacing: Option<f64>,
    /// Name of the rig.
    #[arg(long, default_value = "rig", value_parser = id)]
    rig: String,
    /// Stop after so many frames.
    #[arg(long)]
    frames: Option<u64>,
    /// Stop after so many seconds; without this and --frames Ctrl-C stops.
    #[arg(long, value_parser = clap::value_parser!(u64).range(1..))]
    seconds: Option<u64>,
    /// The session's folder; it must not hold a session yet.
    #[arg(short, long)]
    output: PathBuf,
}

/// What was recorded.
#[derive(Serialize)]
struct Summary {
    session: String,
    frames: u64,
    /// Fixes of the satellite receiver.
    fixes: u64,
    /// Frames that no reader would have taken back.
    unrecorded: u64,
    cameras: Vec<CameraHealth>,
}

pub(super) fn run(args: &Args, output: &Output) -> Result<Exit, CommandError> {
    let cameras = args.pick.cameras()?;
    // A recording for a crop that nothing can replay would be found out too late.
    files::species(&args.species)?;
    let session = format!("rec-{}", jiff::Timestamp::now().strftime("%Y%m%dT%H%M%SZ"));
    let failed = |error: &dyn std::error::Error| CommandError::failed("session", error);
    let position = args.pick.position()?;
    let speed = position.speed(args.speed).ok_or_else(|| {
        CommandError::usage("usage", "expected --speed, or a receiver in the configuration's [position], found neither")
    })?;
    let sown = Sown { species: &args.species, spacing: args.spacing, arm: position.arm() };
    let manifest = manifest(&cameras, sown, &args.rig, &session)?;
    let mut recorder = Recorder::create(&args.output, manifest).map_err(|error| failed(&error))?;
    let stop = interrupted()?;
    let receiver = position.receiver().map(Receiver::open).transpose();
    let receiver = receiver.map_err(|error| CommandError::failed("position", &error))?;
    let positions = receiver.as_ref().map(Receiver::positions).unwrap_or_default();
    let settings: Vec<_> = cameras.iter().map(|camera| camera.settings(speed)).collect::<Result<_, _>>()?;
    let mut source = Cameras::open(&settings, &positions).map_err(|error| CommandError::failed("camera", &error))?;
    let health = source.health();
    let bar = args.frames.map_or_else(ProgressBar::no_length, ProgressBar::new);
    let deadline = args.seconds.map(|seconds| Instant::now() + Duration::from_secs(seconds));
    let (mut frames, mut fixes, mut unrecorded) = (0, 0, 0);
    let mut lenses = BTreeMap::<CameraId, LensWatch>::new();
    let over = |frames| {
        let late = deadline.is_some_and(|deadline| Instant::now() >= deadline);
        late || args.frames.is_some_and(|most| frames >= most) || stop.load(Ordering::Relaxed)
    };
    while !over(frames) {
        fixes += write_fixes(&mut recorder, &positions, fixes)?;
        match source.next() {
            Ok(Some(frame)) => match recorder.write(&frame) {
                Ok(()) => {
                    frames += 1;
                    bar.inc(1);
                    watch(lenses.entry(frame.camera.clone()).or_default(), &frame);
                }
                Err(error @ SessionError::Frame { .. }) => {
                    unrecorded += 1;
                    tracing::warn!("{}", chain(&error));
                }
                Err(error) => return Err(failed(&error)),
            },
            Ok(None) => break,
            // The health counts them.
            Err(SourceError::Quiet | SourceError::Camera(_) | SourceError::Frame(_)) => {}
            Err(error @ SourceError::Lost { .. }) => return Err(CommandError::failed("camera", &error)),
        }
    }
    bar.finish_and_clear();
    fixes += write_fixes(&mut recorder, &positions, fixes)?;
    let cameras = health.read();
    drop(source);
    recorder.finish().map_err(|error| failed(&error))?;
    let whole = |camera: &CameraHealth| camera.frames > 0 && camera.missed + camera.dropped + camera.damaged == 0;
    let done = unrecorded == 0 && cameras.iter().all(whole);
    report(&Summary { session, frames, fixes, unrecorded, cameras }, output)?;
    Ok(if done { Exit::Done } else { Exit::Partial })
}

/// Writes the receiver's fixes after the first `seen`; how many.
fn write_fixes(recorder: &mut Recorder, positions: &Positions, seen: u64) -> Result<u64, CommandError> {
    let fixes = positions.since(seen);
    for fix in &fixes {
        recorder.write_fix(fix).map_err(|error| CommandError::failed("session", &error))?;
    }
    Ok(fixes.len() as u64)
}

/// Says when a lens gets dirty or is covered: an hour of such pictures would be found out too late.
fn watch(lens: &mut LensWatch, frame: &Frame) {
    let due = lens.is_due(frame.stamp.mono_ns);
    // What cannot be decoded is for the replay's gate to count.
    if let Some(picture) = due.then(|| decode(frame).ok()).flatten()
        && let Some(news) = lens.see(frame.stamp.mono_ns, &picture)
    {
        tracing::warn!("camera {}: {news}", frame.camera);
    }
}

fn report(summary: &Summary, output: &Output) -> Result<(), CommandError> {
    if output.json {
        return output.json(summary);
    }
    let Summary { session, frames, fixes, .. } = summary;
    let mut text = format!("{frames} frames and {fixes} fixes in session {session}\n");
    for camera in &summary.cameras {
        let CameraHealth { id, frames, damaged, missed, dropped, reopened, .. } = camera;
        text += &format!(
            "{id}: {frames} came, {missed} missed, {damaged} damaged, {dropped} dropped, {reopened} times reopened\n"
        );
        if let (0, Some(error)) = (frames, &camera.last_error) {
            text += &format!("{id}: {error}\n");
        }
    }
    output.text(&text)
}

/// Set when Ctrl-C or SIGTERM says to stop, so that the session is closed properly.
fn interrupted() -> Result<Arc<AtomicBool>, CommandError> {
    let failed = |error: std::io::Error| CommandError::failed("runtime", &error);
    let runtime = tokio::runtime::Builder::new_current_thread().enable_io().build().map_err(failed)?;
    let stop = Arc::new(AtomicBool::new(false));
    let said = stop.clone();
    std::thread::spawn(move || {
        runtime.block_on(async {
            use tokio::signal::unix::{SignalKind, signal};
            let (Ok(mut interrupt), Ok(mut terminate)) =
                (signal(SignalKind::interrupt()), signal(SignalKind::terminate()))
            else {
                return;
            };
            tokio::select! {
                _ = interrupt.recv() => {}
                _ = terminate.recv() => {}
            }
            said.store(true, Ordering::Relaxed);
        });
    });
    Ok(stop)
}

fn id(text: &str) -> Result<String, String> {
    if is_id(text) { Ok(text.to_owned()) } else { Err(format!("expected {ID}")) }
}

fn speed(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if x.abs() <= 20.0 => Ok(x),
        _ => Err("expected metres a second from -20 to 20".into()),
    }
}
