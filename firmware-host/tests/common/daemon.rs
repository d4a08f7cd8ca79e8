//! A daemon in a folder of its own, watched as systemd watches it.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::os::unix::net::UnixDatagram;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use super::{Bench, stored};

/// How long anything may take that has to come; no test measures time by it.
const PATIENCE: Duration = Duration::from_secs(60);

/// A row of the synthetic world that takes longer than any test.
pub(crate) const LONG: &str = "[source]\nkind = 'synthetic'\nplants = 40\n";

/// It does not outlive a test that failed.
pub(crate) struct Daemon {
    child: Child,
    told: Receiver<String>,
    address: String,
}

impl Drop for Daemon {
    fn drop(&mut self) {
        // It may have ended already.
        self.child.kill().unwrap_or_default();
        self.child.wait().ok();
    }
}

/// Writes the folder's configuration: a store in it, a free port, and more.
pub(crate) fn configure(folder: &Path, more: &str) {
    let config = format!("[store]\npath = 'demeter.sqlite'\n[api]\nlisten = '127.0.0.1:0'\n{more}");
    std::fs::write(folder.join("demeter.toml"), config).unwrap();
}

/// A store with so many plants and a configuration beside it.
pub(crate) fn configured(plants: u32, more: &str) -> Bench {
    let bench = stored(plants);
    configure(bench.folder.path(), more);
    bench
}

/// The command, not started: `demeter run` in the folder, told that systemd listens at `notify` in it.
pub(crate) fn command(folder: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_demeter"));
    command.args(["run", "--config", "demeter.toml"]).current_dir(folder).env_remove("RUST_LOG");
    command.env("NOTIFY_SOCKET", folder.join("notify"));
    command
}

pub(crate) fn socket(folder: &Path) -> UnixDatagram {
    let path = folder.join("notify");
    std::fs::remove_file(&path).ok();
    UnixDatagram::bind(path).unwrap()
}

fn receive(socket: &UnixDatagram) -> String {
    let mut text = [0; 256];
    let length = socket.recv(&mut text).unwrap();
    String::from_utf8(text[..length].to_vec()).unwrap().trim().to_owned()
}

impl Daemon {
    /// Starts it and waits until it is ready.
    pub(crate) fn start(folder: &Path) -> Self {
        Self::start_with(folder, |_| {})
    }

    pub(crate) fn start_with(folder: &Path, change: impl FnOnce(&mut Command)) -> Self {
        let (socket, mut command) = (socket(folder), command(folder));
        change(&mut command);
        let mut child = command.stderr(Stdio::piped()).spawn().unwrap();
        let log = BufReader::new(child.stderr.take().unwrap());
        let (sender, told) = channel();
        // Read all the time, as systemd does: whoever tells waits once a few messages are unread.
        std::thread::spawn(move || while sender.send(receive(&socket)).is_ok() {});
        let mut daemon = Self { child, told, address: String::new() };
        assert_eq!(daemon.told(), "READY=1");
        let mut lines = log.lines().map(Result::unwrap);
        let line = lines.find(|line| line.contains("http://")).unwrap();
        daemon.address = line.split("http://").nth(1).unwrap().trim().to_owned();
        std::thread::spawn(move || lines.for_each(|line| eprintln!("{line}")));
        daemon
    }

    /// What systemd was told next.
    pub(crate) fn told(&self) -> String {
        self.told.recv_timeout(PATIENCE).unwrap()
    }

    pub(crate) fn get(&self, path: &str) -> String {
        let mut stream = TcpStream::connect(&self.address).unwrap();
        write!(stream, "GET {path} HTTP/1.1\r\nHost: {}\r\nConnection: close\r\n\r\n", self.address).unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        answer
    }

    pub(crate) fn status(&self) -> serde_json::Value {
        serde_json::from_str(self.get("/api/v1/status").split("\r\n\r\n").nth(1).unwrap()).unwrap()
    }

    /// The status once it is as wanted.
    pub(crate) fn wait_for(&self, wanted: impl Fn(&serde_json::Value) -> bool) -> serde_json::Value {
        let started = Instant::now();
        loop {
            let status = self.status();
            if wanted(&status) {
                return status;
            }
            assert!(started.elapsed() < PATIENCE, "{status}");
            std::thread::sleep(Duration::from_millis(50));
        }
    }

    /// Sends a signal by its name, such as `TERM`.
    pub(crate) fn signal(&self, name: &str) {
        let killed = Command::new("kill").args([&format!("-{name}"), &self.child.id().to_string()]).status().unwrap();
        assert!(killed.success());
    }

    /// Bytes of memory that it has had at most, as the kernel counts them.
    pub(crate) fn most_memory(&self) -> u64 {
        let status = std::fs::read_to_string(format!("/proc/{}/status", self.child.id())).unwrap();
        let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).unwrap();
        line.trim().strip_suffix(" kB").unwrap().parse::<u64>().unwrap() << 10
    }

    /// The exit code, once it has ended; none after a signal that it could not take.
    pub(crate) fn ended(mut self) -> Option<i32> {
        self.child.wait().unwrap().code()
    }

    /// Keeps a connection open that asks nothing.
    pub(crate) fn idle_client(&self) -> TcpStream {
        TcpStream::connect(&self.address).unwrap()
    }
}
