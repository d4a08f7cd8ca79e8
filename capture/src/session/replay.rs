use std::collections::{BTreeMap, VecDeque};
use std::path::{Path, PathBuf};
use std::thread;
use std::time::{Duration, Instant};

use demeter_frame::{CameraId, Frame, Pose, Stamp};
use serde::de::DeserializeOwned;

use super::index::{IndexLine, PoseLine, checked_fix};
use super::lines::{self, Lines};
use super::{
    FIXES, FileFault, FrameError, FrameFault, INDEX, MANIFEST, MAX_FRAME_BYTES, Manifest, POSES, SessionError, files,
};
use crate::{Fix, Positions, Source, SourceError};

/// Bytes of a session.toml: thousands of rows fit.
const MAX_MANIFEST_BYTES: u64 = 1 << 20;

/// Poses, or fixes, held in memory: ten hours of two cameras at 15 frames a second, about 150 MB.
const MAX_HELD: usize = 1 << 20;

/// Broken lines of poses.jsonl and gnss.jsonl told one by one; each may hold a line, 4 MB in all. More, and the file is
/// something else.
const MAX_FAULTS: usize = 1000;

/// The longest wait between two frames at [`Pace::Real`]: a recorded pause, or a forged stamp, is cut to it.
const MAX_WAIT: Duration = Duration::from_secs(1);

/// How fast a recording is given out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Pace {
    /// As fast as frames are asked for.
    #[default]
    Max,
    /// Not before they would have come from the cameras.
    Real,
}

/// A recorded session as a [`Source`]: frames in the order of the index, each checked against its hash.
#[derive(Debug)]
pub struct Replay {
    root: PathBuf,
    manifest: Manifest,
    index: Lines,
    frames_left: u64,
    poses: BTreeMap<(CameraId, u64), Pose>,
    positions: Positions,
    /// Of the files beside the index.
    faults: VecDeque<FrameError>,
    pace: Pace,
    before: Option<(Instant, u64)>,
}

impl Replay {
    /// Opens a session's folder.
    ///
    /// # Errors
    /// [`SessionError`] for a folder without a sound session.toml and an index. Broken frames and poses are told one by
    /// one by [`Source::next`].
    pub fn open(folder: &Path, pace: Pace) -> Result<Self, SessionError> {
        let io = |source| SessionError::Io { path: folder.to_owned(), source };
        let fault = |file| move |source| SessionError::File { path: folder.to_owned(), file, source };
        let root = folder.canonicalize().map_err(io)?;
        let text = files::read(&root, MANIFEST, MAX_MANIFEST_BYTES).map_err(fault(MANIFEST))?;
        let manifest =
            Manifest::parse(&text).map_err(|source| SessionError::Manifest { path: folder.join(MANIFEST), source })?;
        let open_index = || files::open(&root, INDEX).map_err(fault(INDEX));
        let mut replay = Self {
            frames_left: lines::count(open_index()?).map_err(io)?,
            index: Lines::new(INDEX, open_index()?),
            root: root.clone(),
            manifest,
            poses: BTreeMap::new(),
            positions: Positions::default(),
            faults: VecDeque::new(),
            pace,
            before: None,
        };
        let open = |file| match files::open(&root, file) {
            Ok(opened) => Ok(Some(Lines::new(file, opened))),
            Err(FileFault::Missing { .. }) => Ok(None),
            Err(source) => Err(fault(file)(source)),
        };
        if let Some(lines) = open(POSES)? {
            replay.read(POSES, lines, Self::pose)?;
        }
        if let Some(lines) = open(FIXES)? {
            replay.read(FIXES, lines, Self::fix)?;
        }
        Ok(replay)
    }

    /// What session.toml says.
    #[must_use]
    pub fn manifest(&self) -> &Manifest {
        &self.manifest
    }

    /// Where the antenna was, as far as gnss.jsonl tells.
    #[must_use]
    pub fn positions(&self) -> Positions {
        self.positions.clone()
    }

    /// Reads a file beside the index, line by line; a broken one is told later.
    fn read<T: DeserializeOwned>(
        &mut self,
        file: &'static str,
        mut lines: Lines,
        take: impl Fn(&mut Self, T) -> Result<(), FrameFault>,
    ) -> Result<(), SessionError> {
        let path = self.root.join(file);
        let io = |source| SessionError::Io { path: path.clone(), source };
        let mut held = 0;
        while let Some(line) = lines.next().map_err(io)? {
            let too_many = |what, limit| Err(SessionError::TooMany { path: path.clone(), what, limit });
            match line.and_then(|line| take(self, line)) {
                Ok(()) if held >= MAX_HELD => return too_many("lines", MAX_HELD),
                Ok(()) => held += 1,
                Err(_) if self.faults.len() >= MAX_FAULTS => return too_many("broken lines", MAX_FAULTS),
                Err(fault) => self.faults.push_back(lines.fault(fault)),
            }
        }
        Ok(())
    }

    fn pose(&mut self, line: PoseLine) -> Result<(), FrameFault> {
        let PoseLine { camera, seq, world_from_camera } = line.checked()?;
        known_camera(&self.manifest, &camera)?;
        if self.poses.contains_key(&(camera.clone(), seq)) {
            return Err(FrameFault::Value { key: "seq", expected: "one pose a frame", found: seq.to_string() });
        }
        self.poses.insert((camera, seq), world_from_camera);
        Ok(())
    }

    fn fix(&mut self, fix: Fix) -> Result<(), FrameFault> {
        let fix = checked_fix(fix)?;
        let (boot_id, found) = (fix.boot_id.clone().unwrap_or_else(|| self.manifest.session_id.clone()), fix.t_mono_ns);
        if self.positions.replay(fix, boot_id) {
            return Ok(());
        }
        let expected = "no earlier than the line before";
        Err(FrameFault::Value { key: "t_mono_ns", expected, found: found.to_string() })
    }

    fn frame(&self, line: IndexLine) -> Result<Frame, FrameFault> {
        let line = line.checked()?;
        known_camera(&self.manifest, &line.camera)?;
        let bytes = files::read(&self.root, &line.file, MAX_FRAME_BYTES)?;
        let found = blake3::hash(&bytes).to_hex();
        if !line.blake3.eq_ignore_ascii_case(&found) {
            return Err(FrameFault::Hash { file: line.file, expected: line.blake3, found: found.to_string() });
        }
        let size = self.manifest.camera(&line.camera).map_or((0, 0), |c| (c.intrinsics.width, c.intrinsics.height));
        Ok(Frame {
            world_from_camera: self.poses.get(&(line.camera.clone(), line.seq)).copied(),
            camera: line.camera,
            seq: line.seq,
            stamp: Stamp {
                mono_ns: line.t_mono_ns,
                wall: line.t_wall,
                boot_id: line.boot_id.unwrap_or_else(|| self.manifest.session_id.clone()),
            },
            format: line.format,
            width: line.width.unwrap_or(size.0),
            height: line.height.unwrap_or(size.1),
            stride: line.stride,
            bytes: bytes.into(),
        })
    }

    /// Sleeps until as much time has gone by since the frame before as when they were recorded.
    fn wait(&mut self, mono_ns: u64) {
        if let Some((given, before_ns)) = self.before {
            let gap = Duration::from_nanos(mono_ns.saturating_sub(before_ns)).min(MAX_WAIT);
            thread::sleep(gap.saturating_sub(given.elapsed()));
        }
        self.before = Some((Instant::now(), mono_ns));
    }
}

impl Source for Replay {
    fn next(&mut self) -> Result<Option<Frame>, SourceError> {
        if let Some(fault) = self.faults.pop_front() {
            return Err(fault.into());
        }
        let lost = |source| SourceError::Lost { what: format!("{} in {}", INDEX, self.root.display()), source };
        let Some(line) = self.index.next::<IndexLine>().map_err(lost)? else { return Ok(None) };
        self.frames_left = self.frames_left.saturating_sub(1);
        let frame = line.and_then(|line| self.frame(line)).map_err(|fault| self.index.fault(fault))?;
        if self.pace == Pace::Real {
            self.wait(frame.stamp.mono_ns);
        }
        Ok(Some(frame))
    }

    fn len_hint(&self) -> Option<u64> {
        Some(self.frames_left + self.faults.len() as u64)
    }
}

fn known_camera(manifest: &Manifest, camera: &CameraId) -> Result<(), FrameFault> {
    match manifest.camera(camera) {
        Some(_) => Ok(()),
        None => Err(FrameFault::UnknownCamera { found: camera.0.clone() }),
    }
}
