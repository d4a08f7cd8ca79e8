use std::fs::{File, OpenOptions};
use std::io::{self, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};
use std::time::Duration;

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::termios::{OptionalActions, isatty, tcgetattr, tcsetattr};

use super::gpsd::WATCH;

/// How long reading waits for bytes: a thread looks in between whether it is to stop.
const GLANCE: Duration = Duration::from_millis(200);

/// How long gpsd may take to answer the door; it runs on this box.
const CONNECTING: Duration = Duration::from_secs(1);

/// Where a receiver is read.
#[derive(Clone, Debug, PartialEq)]
pub enum ReceiverSource {
    /// gpsd, at this address.
    Gpsd(SocketAddr),
    /// NMEA sentences from a serial line, a pipe or a file that grows.
    Nmea {
        /// Its path.
        path: PathBuf,
        /// Bits a second, of a serial line.
        baud: u32,
    },
}

impl std::fmt::Display for ReceiverSource {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Gpsd(address) => write!(f, "gpsd at {address}"),
            Self::Nmea { path, .. } => write!(f, "NMEA from {}", path.display()),
        }
    }
}

/// An open line to a receiver.
#[derive(Debug)]
pub(super) enum Port {
    Tcp(TcpStream),
    Serial(File),
    /// A file or a pipe: at its end more may come.
    Growing(File),
}

impl Port {
    pub(super) fn open(source: &ReceiverSource) -> io::Result<Self> {
        match source {
            ReceiverSource::Gpsd(address) => {
                let mut stream = TcpStream::connect_timeout(address, CONNECTING)?;
                stream.set_read_timeout(Some(GLANCE))?;
                stream.set_write_timeout(Some(GLANCE))?;
                stream.write_all(WATCH)?;
                Ok(Self::Tcp(stream))
            }
            ReceiverSource::Nmea { path, baud } => Self::device(path, *baud),
        }
    }

    /// Opening must not wait for a modem's carrier or for a pipe's writer, and no serial line becomes our terminal.
    fn device(path: &Path, baud: u32) -> io::Result<Self> {
        let file = OpenOptions::new().read(true).custom_flags(libc::O_NONBLOCK | libc::O_NOCTTY).open(path)?;
        if !isatty(&file) {
            return Ok(Self::Growing(file));
        }
        let mut line = tcgetattr(&file)?;
        line.make_raw();
        line.set_speed(baud)?;
        tcsetattr(&file, OptionalActions::Now, &line)?;
        Ok(Self::Serial(file))
    }

    /// Bytes, as many as are there; `None` when none came for a while.
    pub(super) fn read(&mut self, buffer: &mut [u8]) -> io::Result<Option<usize>> {
        let read = match self {
            Self::Tcp(stream) => stream.read(buffer),
            Self::Serial(file) | Self::Growing(file) => {
                let glance = Timespec { tv_sec: 0, tv_nsec: GLANCE.subsec_nanos().into() };
                match poll(&mut [PollFd::new(file, PollFlags::IN)], Some(&glance)) {
                    Ok(0) => return Ok(None),
                    Ok(_) => file.read(buffer),
                    Err(error) => Err(error.into()),
                }
            }
        };
        match (read, self) {
            (Ok(0), Self::Growing(_)) => {
                std::thread::sleep(GLANCE);
                Ok(None)
            }
            (Ok(0), _) => Err(io::Error::new(io::ErrorKind::UnexpectedEof, "the receiver has gone")),
            (Ok(bytes), _) => Ok(Some(bytes)),
            (Err(error), _) => match error.kind() {
                io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut | io::ErrorKind::Interrupted => Ok(None),
                _ => Err(error),
            },
        }
    }
}
