//! The camera lab (../shared/tools/camera-lab): a Linux in user space with real V4L2 and USB drivers and real systemd,
//! in which a test runs a script as root. One boot takes two seconds, or six with systemd.
//!
//! Test files that use it are named `lab_*.rs`: .config/nextest.toml runs them one at a time.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

use tempfile::TempDir;

use crate::{demeter_path, root, shared};

/// Where the guest sees the job's folder.
pub const GUEST: &str = "/run/host";

/// One machine that runs one script: its folder is shared with it as [`GUEST`] and on the guest's PATH.
pub struct Lab {
    tools: PathBuf,
    folder: TempDir,
    systemd: bool,
    limit: Duration,
}

/// What came of a script.
#[derive(Debug)]
pub struct Done {
    /// The script's exit status; 124 when it ran out of time, 125 when the machine did not get as far.
    pub status: i32,
    /// All that was printed, the kernel's lines among it.
    pub console: String,
}

impl Lab {
    /// A machine, or `None` where ../shared is absent, which has then been announced. The first makes the root image.
    ///
    /// # Panics
    /// When the image cannot be made: the lab is there, so its tests must run.
    pub fn new(test: &str) -> Option<Self> {
        let tools = shared(test, "tools/camera-lab")?;
        let made = Command::new(root().join("tools/camera-lab.sh")).status().expect("bash starts");
        assert!(made.success(), "{test}: tools/camera-lab.sh: {made}");
        let folder = tempfile::tempdir().expect("a folder");
        Some(Self { tools, folder, systemd: false, limit: Duration::from_secs(60) })
    }

    /// Boots systemd instead of the script alone.
    #[must_use]
    pub fn systemd(self) -> Self {
        Self { systemd: true, ..self }
    }

    /// Stops the machine after this time instead of a minute, boot included.
    #[must_use]
    pub fn limit(self, limit: Duration) -> Self {
        Self { limit, ..self }
    }

    /// Where a file of the guest's [`GUEST`] is on this side.
    #[must_use]
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Copies a file or a folder into the job's folder.
    ///
    /// # Panics
    /// When it cannot be copied.
    pub fn put(&self, name: &str, from: &Path) {
        let copied = Command::new("cp").arg("-RL").arg(from).arg(self.path(name)).status().expect("cp starts");
        assert!(copied.success(), "{}: {copied}", from.display());
    }

    /// Puts the program there, with the networks and the library it needs to make plants.
    pub fn put_demeter(&self) {
        self.put("demeter", &demeter_path());
        self.put("models", &root().join("models"));
        let cache = root().join(".cache/onnxruntime");
        for entry in cache.read_dir().expect("tools/setup.sh was run").flatten() {
            let name = entry.file_name().into_string().expect("a plain name");
            if name.starts_with("libonnxruntime") {
                self.put(&name, &entry.path());
            }
        }
    }

    /// Puts the webcam made of software there: `usb-camera FRAMES.mjpg FPS`.
    pub fn put_usb_camera(&self) {
        self.put("usb-camera", &root().join(".cache/lab/usb-camera"));
    }

    /// Runs a bash script as root in the job's folder; the first command that fails ends it.
    ///
    /// # Panics
    /// When the machine cannot be started.
    pub fn run(&self, script: &str) -> Done {
        let script = format!("set -euo pipefail\nexport PATH={GUEST}:$PATH\n{script}\n");
        std::fs::write(self.path("job.sh"), script).expect("writes");
        let mut machine = Command::new(self.tools.join("run.sh"));
        if self.systemd {
            machine.arg("--systemd");
        }
        machine.arg("--timeout").arg(self.limit.as_secs().to_string());
        machine.arg(root().join(".cache/lab/root.img")).arg(self.folder.path());
        let output = machine.stdin(Stdio::null()).output().expect("run.sh starts");
        let console = [output.stdout, output.stderr].concat();
        let console = String::from_utf8_lossy(&console).into_owned();
        Done { status: output.status.code().unwrap_or(125), console }
    }
}

impl Done {
    /// What the script printed, after it is certain that all of it went well.
    ///
    /// # Panics
    /// When a command failed or time ran out; the console is told.
    pub fn ok(self) -> String {
        assert_eq!(self.status, 0, "the machine said:\n{}", self.console);
        self.console
    }
}

/// Bash that records in the background and waits for things to happen: `start NAME "OPTIONS"` begins session NAME with
/// its log in NAME.log, `frames NAME COUNT` waits until it holds so many frames, `said NAME TEXT [COUNT]` until its log
/// says so, `finish NAME` ends it and leaves the summary in NAME.json.
pub const RECORDING: &str = r#"
start() {
    demeter camera record $2 --json --speed 0.5 -o $1 >$1.json 2>$1.log &
    recorder=$!
}
wait_for() {
    for _ in $(seq 200); do eval "$1" && return 0; sleep 0.1; done
    echo "waited in vain: $1"; cat *.log; return 1
}
frames() { wait_for "[ \$(cat $1/index.jsonl 2>/dev/null | wc -l) -ge $2 ]"; }
said() { wait_for "[ \$(grep -c '$2' $1.log) -ge ${3:-1} ]"; }
# Exit status 3 means that a frame was lost, which is what most tests are about.
finish() { kill -INT $recorder; wait $recorder || [ $? = 3 ]; }
"#;
