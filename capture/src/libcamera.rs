//! Cameras that need a pipeline in user space, through Debian's program `cam` (package libcamera-tools) as a child: the
//! library aborts its process when a camera is unplugged.
//!
//! `cam` prints a line for each frame after it wrote the frame's bytes to a file. It has no descriptor to spare for that
//! file but its standard input, which it does not read: that is the writing end of a pipe.

use std::io::{self, BufRead, BufReader, PipeReader, Read};
use std::process::{Child, ChildStdout, Command, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::time::Duration;

use demeter_frame::PixelFormat;

use crate::camera::driver::{Driver, Layout, Shot, Stream};
use crate::session::MAX_FRAME_BYTES;
use crate::{CameraFault, CameraSettings, Mode};

const PROGRAM: &str = "cam";

/// Bytes read from the pipe at once: what Linux keeps in one.
const CHUNK: usize = 64 << 10;

/// The longest line that is read, bytes; those of frames have about 70.
const MAX_LINE: u64 = 1000;

/// A camera by libcamera's id, which is made of where it is plugged in.
pub(crate) struct Camera(pub(crate) CameraSettings);

impl Driver for Camera {
    fn open(&self) -> Result<Box<dyn Stream>, CameraFault> {
        let Mode { format, width, height, .. } = self.0.mode;
        let (frames, file) = io::pipe().map_err(CameraFault::refused("making a pipe"))?;
        let stream = format!("width={width},height={height},pixelformat={}", name(format));
        let mut child = Command::new(PROGRAM)
            .args(["--camera", &self.0.device, "--stream", &stream, "--strict-formats", "--capture"])
            .arg("--file=/proc/self/fd/0")
            .stdin(file)
            .stdout(Stdio::piped())
            .stderr(Stdio::inherit())
            .spawn()
            .map_err(CameraFault::refused("starting `cam`: install libcamera-tools"))?;
        let lines = child.stdout.take();
        let (give, shots) = sync_channel(1);
        let layout = Layout { format, width, height, stride: 0 };
        let stream = Cam { child, shots, layout };
        if let Some(lines) = lines {
            std::thread::spawn(move || assemble(lines, frames, &give));
        }
        Ok(Box::new(stream))
    }
}

/// The child; killed and waited for when dropped, which ends its threads too.
struct Cam {
    child: Child,
    shots: Receiver<Shot>,
    layout: Layout,
}

impl Stream for Cam {
    fn layout(&self) -> Layout {
        self.layout
    }

    fn grab(&mut self, wait: Duration) -> Result<Option<Shot>, CameraFault> {
        match self.shots.recv_timeout(wait) {
            Ok(shot) => {
                self.layout.stride = stride(&self.layout, shot.bytes.len());
                Ok(Some(shot))
            }
            Err(RecvTimeoutError::Timeout) => Ok(None),
            Err(RecvTimeoutError::Disconnected) => {
                let ended = self.child.wait().map_or_else(|error| error.to_string(), |status| status.to_string());
                Err(CameraFault::Child { program: PROGRAM, message: format!("it ended: {ended}") })
            }
        }
    }
}

impl Drop for Cam {
    fn drop(&mut self) {
        // It may have ended already; waiting for it is what matters, so that it does not stay as a zombie.
        let ended = self.child.kill().and_then(|()| self.child.wait());
        if let Err(error) = ended {
            tracing::warn!("{PROGRAM}: {error}");
        }
    }
}

/// Puts lines and bytes together until either ends. The bytes of a frame come before its line and fill the pipe many
/// times over, so another thread keeps it empty.
fn assemble(lines: ChildStdout, frames: PipeReader, to: &SyncSender<Shot>) {
    let (give, chunks) = sync_channel(MAX_FRAME_BYTES as usize / CHUNK);
    std::thread::spawn(move || drain(frames, &give));
    let mut lines = BufReader::new(lines);
    let mut waiting = Vec::new();
    loop {
        let mut line = String::new();
        match lines.by_ref().take(MAX_LINE).read_line(&mut line) {
            Ok(0) | Err(_) => return,
            Ok(_) => {}
        }
        let Some(report) = Report::parse(&line) else { continue };
        while waiting.len() < report.bytes {
            let Ok(chunk) = chunks.recv() else { return };
            waiting.extend::<Vec<u8>>(chunk);
        }
        let rest = waiting.split_off(report.bytes);
        let bytes = std::mem::replace(&mut waiting, rest).into();
        if to.send(Shot { count: report.count, mono_ns: report.mono_ns, bytes, damaged: false }).is_err() {
            return;
        }
    }
}

fn drain(mut frames: PipeReader, to: &SyncSender<Vec<u8>>) {
    let mut chunk = vec![0; CHUNK];
    while let Ok(read @ 1..) = frames.read(&mut chunk) {
        if to.send(chunk[..read].to_vec()).is_err() {
            return;
        }
    }
}

/// What `cam` says of a frame: `3.334439 (26.86 fps) cam0-stream0 seq: 000001 bytesused: 915840/457920`, the time in
/// seconds on CLOCK_MONOTONIC and the bytes of each plane.
#[derive(Debug, PartialEq)]
struct Report {
    mono_ns: u64,
    count: u32,
    bytes: usize,
}

impl Report {
    /// `None` for any other line, and for a frame larger than any.
    fn parse(line: &str) -> Option<Self> {
        let (time, rest) = line.split_once(" (")?;
        let (seconds, micros) = time.split_once('.')?;
        let (count, bytes) = rest.split_once("seq: ")?.1.split_once(" bytesused: ")?;
        let planes = bytes.split_whitespace().next()?.split('/').map(str::parse::<u64>);
        let bytes = planes.sum::<Result<u64, _>>().ok()?;
        let micros = seconds.parse::<u64>().ok()?.checked_mul(1_000_000)?.checked_add(micros.parse().ok()?)?;
        (micros > 0 && bytes <= MAX_FRAME_BYTES).then_some(Self {
            mono_ns: micros.checked_mul(1000)?,
            count: count.parse().ok()?,
            bytes: bytes as usize,
        })
    }
}

/// Bytes a row, which `cam` does not say: those of the frame over its rows.
fn stride(layout: &Layout, bytes: usize) -> u32 {
    let half_rows = match layout.format {
        PixelFormat::Jpeg => return 0,
        PixelFormat::Nv12 => 3 * layout.height,
        _ => 2 * layout.height,
    };
    u32::try_from(2 * bytes / half_rows.max(1) as usize).unwrap_or(0)
}

/// libcamera's name of a format: it counts colours from the last byte.
fn name(format: PixelFormat) -> &'static str {
    match format {
        PixelFormat::Jpeg => "MJPEG",
        PixelFormat::Rgb24 => "BGR888",
        PixelFormat::Yuyv => "YUYV",
        PixelFormat::Nv12 => "NV12",
        PixelFormat::Grey => "R8",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_of_frames_are_told_from_others() {
        let line = "3.034439 (0.00 fps) cam0-stream0 seq: 000012 bytesused: 307200/153600\n";
        let report = Report { mono_ns: 3_034_439_000, count: 12, bytes: 460_800 };
        assert_eq!(Report::parse(line), Some(report));
        for other in [
            "Using camera platform/vimc.0 Sensor B as cam0\n",
            "cam0: Capture until user interrupts by SIGINT\n",
            "3.03 (0.00 fps) cam0-stream0 seq: 1 bytesused: 99999999999\n",
            "3.03 (0.00 fps) cam0-stream0 seq: -1 bytesused: 5\n",
            "99999999999999999999.0 (0.00 fps) cam0-stream0 seq: 1 bytesused: 5\n",
            "3.0 (",
            "",
        ] {
            assert_eq!(Report::parse(other), None, "{other}");
        }
    }

    #[test]
    fn rows_are_as_long_as_the_frame_says() {
        let layout = |format| Layout { format, width: 636, height: 480, stride: 0 };
        assert_eq!(stride(&layout(PixelFormat::Rgb24), 640 * 3 * 480), 1920);
        assert_eq!(stride(&layout(PixelFormat::Nv12), 640 * 480 * 3 / 2), 640);
        assert_eq!(stride(&layout(PixelFormat::Jpeg), 5000), 0);
    }
}
