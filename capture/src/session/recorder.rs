use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use demeter_frame::{Frame, PixelFormat};
use serde::Serialize;

use super::index::{IndexLine, PoseLine, checked_fix};
use super::lines::MAX_LINE;
use super::{FIXES, FRAMES, FileFault, FrameFault, INDEX, MANIFEST, MAX_FRAME_BYTES, Manifest, POSES, SessionError};
use crate::Fix;

/// Writes a recorded session.
///
/// A frame's line enters the index after its bytes are in their file, so whatever the index names was written whole. A
/// power cut may lose the last seconds; their frames then fail their hash. [`Recorder::finish`] makes all of it durable.
#[derive(Debug)]
pub struct Recorder {
    folder: PathBuf,
    manifest: Manifest,
    index: Log,
    poses: Option<Log>,
    fixes: Option<Log>,
}

impl Recorder {
    /// Makes the folder (and those above it) and writes session.toml.
    ///
    /// # Errors
    /// [`SessionError::Exists`] when the folder holds a session; [`SessionError::Manifest`] for one that no reader would
    /// take.
    pub fn create(folder: &Path, manifest: Manifest) -> Result<Self, SessionError> {
        let text =
            manifest.to_toml().map_err(|source| SessionError::Manifest { path: folder.join(MANIFEST), source })?;
        let io = |source| SessionError::Io { path: folder.to_owned(), source };
        fs::create_dir_all(folder).map_err(io)?;
        for name in [MANIFEST, INDEX, POSES, FIXES, FRAMES] {
            if fs::symlink_metadata(folder.join(name)).is_ok() {
                return Err(SessionError::Exists { path: folder.to_owned() });
            }
        }
        fs::create_dir(folder.join(FRAMES)).map_err(io)?;
        let recorder = Self {
            index: Log::create(folder.join(INDEX))?,
            poses: None,
            fixes: None,
            folder: folder.to_owned(),
            manifest,
        };
        // session.toml comes last and whole: a folder that has it is a session.
        let unnamed = folder.join("session.toml.new");
        fs::write(&unnamed, text).and_then(|()| File::open(&unnamed)?.sync_all()).map_err(io)?;
        fs::rename(unnamed, folder.join(MANIFEST)).map_err(io)?;
        Ok(recorder)
    }

    /// Appends one frame: its bytes, its pose if it has one, its line.
    ///
    /// # Errors
    /// [`SessionError::Frame`] for a frame that no reader would take back, [`SessionError::Io`] when the disk refuses or
    /// the camera's number was used before. The index stays whole and the next frame may be written.
    pub fn write(&mut self, frame: &Frame) -> Result<(), SessionError> {
        let refused = |source| SessionError::Frame { camera: frame.camera.0.clone(), seq: frame.seq, source };
        let index = self.index_line(frame).map_err(refused)?;
        let line = to_line(&index).map_err(refused)?;
        let pose = frame.world_from_camera.map(|world_from_camera| {
            let pose = PoseLine { camera: frame.camera.clone(), seq: frame.seq, world_from_camera };
            pose.checked().and_then(|pose| to_line(&pose))
        });
        let pose = pose.transpose().map_err(refused)?;
        let path = self.folder.join(&index.file);
        write_new(&path, &frame.bytes).map_err(|source| SessionError::Io { path, source })?;
        if let Some(pose) = pose {
            Log::of(&mut self.poses, &self.folder, POSES)?.append(&pose)?;
        }
        self.index.append(&line)
    }

    /// Appends a fix of the rig's receiver.
    ///
    /// # Errors
    /// [`SessionError::Io`] when the disk refuses; [`SessionError::Fix`] for one that no reader would take back.
    pub fn write_fix(&mut self, fix: &Fix) -> Result<(), SessionError> {
        let ours = fix.boot_id.as_ref() == Some(&self.manifest.session_id);
        let fix = Fix { boot_id: fix.boot_id.clone().filter(|_| !ours), ..fix.clone() };
        let line = checked_fix(fix).and_then(|fix| to_line(&fix)).map_err(|source| SessionError::Fix { source })?;
        Log::of(&mut self.fixes, &self.folder, FIXES)?.append(&line)
    }

    /// Makes everything durable.
    ///
    /// # Errors
    /// [`SessionError::Io`] when the disk refuses: the recording may then be incomplete.
    pub fn finish(self) -> Result<(), SessionError> {
        self.index.sync()?;
        for log in [&self.poses, &self.fixes] {
            log.as_ref().map_or(Ok(()), Log::sync)?;
        }
        for folder in [self.folder.join(FRAMES), self.folder.clone()] {
            File::open(&folder)
                .and_then(|opened| opened.sync_all())
                .map_err(|source| SessionError::Io { path: folder, source })?;
        }
        Ok(())
    }

    fn index_line(&self, frame: &Frame) -> Result<IndexLine, FrameFault> {
        if self.manifest.camera(&frame.camera).is_none() {
            return Err(FrameFault::UnknownCamera { found: frame.camera.0.clone() });
        }
        let ending = match frame.format {
            PixelFormat::Jpeg => "jpg",
            PixelFormat::Rgb24 => "rgb",
            raw => raw.name(),
        };
        let file = format!("{FRAMES}/{}-{:08}.{ending}", frame.camera, frame.seq);
        if frame.bytes.len() as u64 > MAX_FRAME_BYTES {
            return Err(FileFault::Oversized { file, limit: MAX_FRAME_BYTES }.into());
        }
        let line = IndexLine {
            camera: frame.camera.clone(),
            seq: frame.seq,
            t_mono_ns: frame.stamp.mono_ns,
            t_wall: frame.stamp.wall.clone(),
            boot_id: Some(&frame.stamp.boot_id).filter(|id| **id != self.manifest.session_id).cloned(),
            file,
            blake3: blake3::hash(&frame.bytes).to_string(),
            format: frame.format,
            width: Some(frame.width),
            height: Some(frame.height),
            stride: frame.stride,
        };
        line.checked()
    }
}

/// One JSON line with its end, of a length that is read back.
fn to_line(value: &impl Serialize) -> Result<Vec<u8>, FrameFault> {
    let mut line = serde_json::to_vec(value).map_err(|source| FrameFault::Line { source })?;
    line.push(b'\n');
    if line.len() as u64 > MAX_LINE { Err(FrameFault::LineTooLong { limit: MAX_LINE }) } else { Ok(line) }
}

/// Writes a file that must not be there yet; a half-written one is taken away again.
fn write_new(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut file = File::create_new(path)?;
    file.write_all(bytes).or_else(|error| fs::remove_file(path).and(Err(error)))
}

/// A file that only grows, by whole pieces.
#[derive(Debug)]
struct Log {
    path: PathBuf,
    file: File,
    len: u64,
}

impl Log {
    fn create(path: PathBuf) -> Result<Self, SessionError> {
        match OpenOptions::new().append(true).create_new(true).open(&path) {
            Ok(file) => Ok(Self { path, file, len: 0 }),
            Err(source) => Err(SessionError::Io { path, source }),
        }
    }

    /// The log in its place, made where there is none yet.
    fn of<'a>(place: &'a mut Option<Self>, folder: &Path, name: &str) -> Result<&'a mut Self, SessionError> {
        let log = match place.take() {
            Some(log) => log,
            None => Self::create(folder.join(name))?,
        };
        Ok(place.insert(log))
    }

    /// Appends all of `piece`, or takes back what was written of it.
    fn append(&mut self, piece: &[u8]) -> Result<(), SessionError> {
        let written = self.file.write_all(piece).or_else(|error| self.file.set_len(self.len).and(Err(error)));
        written.map_err(|source| SessionError::Io { path: self.path.clone(), source })?;
        self.len += piece.len() as u64;
        Ok(())
    }

    fn sync(&self) -> Result<(), SessionError> {
        self.file.sync_all().map_err(|source| SessionError::Io { path: self.path.clone(), source })
    }
}
