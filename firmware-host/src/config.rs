//! The configuration file: TOML, every key optional, unknown keys refused with a suggestion.

mod brapi;
mod lamp;
mod position;
mod sync;
mod thermal;

use std::cmp::Ordering;
use std::io::Read;
use std::net::{Ipv4Addr, SocketAddr};
use std::path::{Path, PathBuf};

use serde::Deserialize;

pub use brapi::BrapiConfig;
pub use camera::CameraConfig;
pub use lamp::LampConfig;
pub use position::{PositionConfig, PositionSource, Side};
pub use sync::SyncConfig;
pub use thermal::ThermalConfig;

use crate::error::CommandError;

pub mod camera;

/// Where the service keeps its configuration; read when it is there and no other is named.
const DEFAULT_PATH: &str = "/etc/demeter/demeter.toml";

/// Largest file read, bytes: a guess a thousand times above any sensible configuration.
const MAX_BYTES: u64 = 1 << 20;

/// What `demeter run` is told.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Config {
    /// Where plants are kept.
    pub store: StoreConfig,
    /// Where the page and the API listen.
    pub api: ApiConfig,
    /// Which networks look at pictures.
    pub models: ModelsConfig,
    /// When a hot box sheds load.
    pub thermal: ThermalConfig,
    /// What the driver sees and hears.
    pub lamp: LampConfig,
    /// How the rig knows where it is.
    pub position: PositionConfig,
    /// Where plants go at night.
    pub sync: SyncConfig,
    /// Where frames come from; without it stored plants are served and nothing else.
    pub source: Option<SourceConfig>,
    /// The rig's cameras, which a source of the kind `cameras` reads.
    pub cameras: Vec<CameraConfig>,
}

/// `[store]`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct StoreConfig {
    /// The SQLite file; relative to the working folder, which the service sets to /var/lib/demeter.
    pub path: PathBuf,
    /// With less free than this, mebibytes, plants wait; they are stored when twice as much is free. The default is a
    /// guess at what the system and the store's own log need to go on.
    pub min_free_mib: u64,
}

impl StoreConfig {
    /// [`StoreConfig::min_free_mib`] in bytes.
    #[must_use]
    pub fn min_free_bytes(&self) -> u64 {
        self.min_free_mib.saturating_mul(1 << 20)
    }
}

impl Default for StoreConfig {
    fn default() -> Self {
        Self { path: "demeter.sqlite".into(), min_free_mib: 64 }
    }
}

/// `[api]`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ApiConfig {
    /// Loopback only: the token that other networks need is not there yet.
    pub listen: SocketAddr,
}

impl Default for ApiConfig {
    fn default() -> Self {
        Self { listen: (Ipv4Addr::LOCALHOST, 8420).into() }
    }
}

/// Name of our network's manifest.
pub const OURS: &str = "organ2d";
/// Our network for depth.
const RELIEF: &str = "relief2d";

/// `[models]`: names of installed models (`demeter models list`) in place of what our network says (docs/models.md).
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ModelsConfig {
    /// What parts plants from the rest: nothing, U²-Net alone, or SAM's encoder and decoder.
    pub mask: Vec<String>,
    /// What finds the organs.
    pub organs: String,
    /// What gives depth.
    pub depth: String,
}

impl Default for ModelsConfig {
    fn default() -> Self {
        Self { mask: Vec::new(), organs: OURS.into(), depth: RELIEF.into() }
    }
}

impl ModelsConfig {
    /// The same for rows: on a known ground, whose plane corrects depth, organ2d's tells the plants of a row apart better
    /// than relief2d's (docs/training.md).
    #[must_use]
    pub fn in_rows(&self) -> Self {
        let depth = if self.depth == RELIEF { OURS } else { &self.depth };
        Self { depth: depth.into(), ..self.clone() }
    }
}

/// `[source]`, chosen by its key `kind`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum SourceConfig {
    /// A recorded session, at the pace it was recorded.
    Replay {
        /// The session's folder.
        session: PathBuf,
    },
    /// A row of the synthetic world.
    Synthetic {
        /// A species that ships.
        #[serde(default = "soybean")]
        species: String,
        /// Plants in the row.
        #[serde(default = "six")]
        plants: u16,
        /// The same seed gives the same row.
        #[serde(default)]
        seed: u64,
    },
    /// The cameras of `[[cameras]]`.
    Cameras {
        /// The crop: a species that ships.
        #[serde(default = "soybean")]
        species: String,
        /// How fast the rig drives, metres a second; negative when the row passes from left to right. Without it the
        /// receiver of `[position]` measures the speed.
        #[serde(default)]
        speed_m_per_s: Option<f64>,
        /// Distance from plant to plant as sown, metres: what is seen much nearer belongs to the same plant.
        #[serde(default)]
        spacing_m: Option<f64>,
    },
}

fn soybean() -> String {
    "soybean".into()
}

fn six() -> u16 {
    6
}

/// Why a configuration is refused; every message names the file.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// It cannot be read.
    #[error("configuration {path}: {source}")]
    Io {
        /// The file.
        path: PathBuf,
        /// The system's own error.
        source: std::io::Error,
    },
    /// Larger than any configuration.
    #[error("configuration {path}: expected at most {expected} bytes, found more")]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// The bound.
        expected: u64,
    },
    /// No TOML, an unknown key or a value of the wrong type.
    #[error("configuration {path}: {message}{suggestion}")]
    Syntax {
        /// The file.
        path: PathBuf,
        /// The line, what was expected and what was found.
        message: String,
        /// The known key that was probably meant.
        suggestion: String,
    },
    /// A value that is understood and not allowed.
    #[error("configuration {path}: `{key}`: expected {expected}, found {found}")]
    Value {
        /// The file.
        path: PathBuf,
        /// The key.
        key: &'static str,
        /// What is allowed.
        expected: &'static str,
        /// What is there.
        found: String,
    },
}

impl From<ConfigError> for CommandError {
    fn from(error: ConfigError) -> Self {
        let usage = Self::usage("configuration", &error);
        match error {
            ConfigError::Value { expected, found, .. } => usage.with(expected, found),
            _ => usage,
        }
    }
}

impl Config {
    /// Reads the named file, else the service's where there is one, else nothing: the defaults run without editing.
    ///
    /// # Errors
    /// [`ConfigError`] naming the file and the key.
    pub fn load(path: Option<&Path>) -> Result<Self, ConfigError> {
        match path {
            Some(path) => Self::read(path),
            None if Path::new(DEFAULT_PATH).exists() => Self::read(Path::new(DEFAULT_PATH)),
            None => Ok(Self::default()),
        }
    }

    fn read(path: &Path) -> Result<Self, ConfigError> {
        let io = |source| ConfigError::Io { path: path.into(), source };
        let mut text = String::new();
        // Bounded by what is read and not by the size announced, which a pipe has not.
        let file = std::fs::File::open(path).map_err(io)?;
        let bytes = file.take(MAX_BYTES + 1).read_to_string(&mut text).map_err(io)?;
        if bytes as u64 > MAX_BYTES {
            return Err(ConfigError::TooLarge { path: path.into(), expected: MAX_BYTES });
        }
        let config: Self = toml::from_str(&text).map_err(|error| ConfigError::Syntax {
            path: path.into(),
            message: error.to_string().trim_end().to_owned(),
            suggestion: suggestion(error.message()).map_or_else(String::new, |key| format!("\ndid you mean `{key}`?")),
        })?;
        if !config.api.listen.ip().is_loopback() {
            return Err(ConfigError::Value {
                path: path.into(),
                key: "api.listen",
                expected: "a loopback address such as 127.0.0.1:8420",
                found: config.api.listen.to_string(),
            });
        }
        let ThermalConfig { hot_c, cool_c, .. } = config.thermal;
        // NaN is not less than anything.
        if cool_c.partial_cmp(&hot_c) != Some(Ordering::Less) {
            return Err(ConfigError::Value {
                path: path.into(),
                key: "thermal.cool_c",
                expected: "less than thermal.hot_c",
                found: format!("{cool_c} and {hot_c}"),
            });
        }
        if config.models.mask.len() > 2 {
            return Err(ConfigError::Value {
                path: path.into(),
                key: "models.mask",
                expected: "at most two names: a saliency network, or SAM's encoder and decoder",
                found: format!("{:?}", config.models.mask),
            });
        }
        match config.position.check().err().or_else(|| config.wrong_camera()) {
            Some((key, expected, found)) => Err(ConfigError::Value { path: path.into(), key, expected, found }),
            None => Ok(config),
        }
    }

    fn wrong_camera(&self) -> Option<camera::BadValue> {
        let ids: std::collections::BTreeSet<_> = self.cameras.iter().map(|camera| &camera.id).collect();
        if let Some(SourceConfig::Cameras { speed_m_per_s, spacing_m, .. }) = &self.source {
            if self.cameras.is_empty() {
                return Some(("cameras", "at least one [[cameras]] for a source of this kind", "none".into()));
            }
            if let Some(speed) = speed_m_per_s.filter(|speed| !(-20.0..=20.0).contains(speed)) {
                return Some(("source.speed_m_per_s", "-20 to 20 metres a second", speed.to_string()));
            }
            if self.position.speed(*speed_m_per_s).is_none() {
                return Some(("source.speed_m_per_s", "a speed, or a receiver in [position]", "neither".into()));
            }
            if let Some(spacing) = spacing_m.filter(|spacing| !(0.01..=10.0).contains(spacing)) {
                return Some(("source.spacing_m", "0.01 to 10 metres", spacing.to_string()));
            }
        }
        if ids.len() != self.cameras.len() {
            return Some(("cameras.id", "a name of its own for each camera", format!("{ids:?}")));
        }
        self.cameras.iter().find_map(|camera| camera.check().err())
    }
}

/// The known key nearest to the unknown one, out of serde's message: it quotes the unknown key first, then the known.
fn suggestion(message: &str) -> Option<&str> {
    let mut quoted = message.strip_prefix("unknown field ")?.split('`').skip(1).step_by(2);
    let unknown = quoted.next()?;
    // A third of the letters may be wrong: beyond that a suggestion misleads.
    let near = |key: &&str| strsim::damerau_levenshtein(unknown, key) <= unknown.len().max(3) / 3;
    quoted.filter(near).min_by_key(|key| strsim::damerau_levenshtein(unknown, key))
}

#[cfg(test)]
mod tests {
    use super::*;

    const LEFT: &str = "[[cameras]]\nid = 'left'\ndevice = 'usb-1'\nhfov_deg = 60\nheight_m = 1\ntilt_deg = -100";

    fn read(text: &str) -> Result<Config, String> {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), text).unwrap();
        Config::load(Some(file.path())).map_err(|error| {
            let error = CommandError::from(error);
            assert_eq!(error.exit, crate::error::Exit::BadUse);
            assert!(error.message.contains(&file.path().display().to_string()), "{}", error.message);
            error.message
        })
    }

    #[test]
    fn an_empty_file_is_the_default_and_values_are_taken() {
        assert_eq!(read(""), Ok(Config::default()));
        let config = read("[store]\npath = 'x.sqlite'\n[api]\nlisten = '[::1]:80'").unwrap();
        assert_eq!(config.store.path, Path::new("x.sqlite"));
        assert_eq!(config.api.listen.port(), 80);
        let config = read("[models]\nmask = ['e', 'd']\ndepth = 'meter'").unwrap();
        assert_eq!((config.models.mask.len(), &*config.models.organs, &*config.models.depth), (2, OURS, "meter"));
    }

    #[test]
    fn mistakes_name_the_key_what_was_expected_and_what_was_found() {
        for (text, parts) in [
            ("[stroe]\npath = 'x'", &["stroe", "did you mean `store`?"][..]),
            ("[api]\nlistn = '127.0.0.1:1'", &["listn", "did you mean `listen`?"]),
            (
                "[harvester]",
                &[
                    "harvester",
                    "expected one of `store`, `api`, `models`, `thermal`, `lamp`, `position`, `sync`, `source`, `cameras`",
                ],
            ),
            ("[[cameras]]\nid = 'left'", &["missing field `device`"]),
            ("[source]\nkind = 'cameras'\nspeed_m_per_s = 1", &["cameras", "at least one", "none"]),
            (&LEFT.replace("left", "../left"), &["cameras.id", "letters, digits", "../left"]),
            (&LEFT.replace("left", ""), &["cameras.id", "1 to 64", "\"\""]),
            (
                "[source]\nkind = 'cameras'\n[[cameras]]\nid = 'a'\ndevice = 'b'\nhfov_deg = 60\nheight_m = 1",
                &["source.speed_m_per_s", "a receiver in [position]", "neither"],
            ),
            (
                "[[cameras]]\nid = 'a'\ndevice = 'b'\nheight_m = 1",
                &["cameras.hfov_deg", "10 to 170 degrees, or a file under calibration", "neither"],
            ),
            ("[position]\nsource = 'gps'", &["unknown variant `gps`", "`speed`, `gpsd`, `nmea`"]),
            ("[position]\nlatency_s = nan", &["position.latency_s", "0 to 5 seconds", "NaN"]),
            ("[position]\nbaud = 5", &["position.baud", "bits a second", "5"]),
            ("[position]\ngpsd = 'here'", &["gpsd = 'here'", "address"]),
            ("[position]\ncameras_from_antenna_m = [1, nan]", &["cameras_from_antenna_m", "20 metres", "NaN"]),
            (LEFT, &["cameras.tilt_deg", "-90 to 90", "-100"]),
            ("[[cameras]]\nid = 'left'\ndevise = 'usb'", &["devise", "did you mean `device`?"]),
            ("[store]\npath = 5", &["path = 5", "integer", "expected"]),
            ("[api]\nlisten = 'here'", &["listen = 'here'", "address"]),
            ("[api]\nlisten = '0.0.0.0:8420'", &["api.listen", "loopback", "0.0.0.0:8420"]),
            ("[models]\nmask = ['a', 'b', 'c']", &["models.mask", "at most two", "\"c\""]),
            ("[thermal]\nhot_c = 60", &["thermal.cool_c", "less than thermal.hot_c", "70 and 60"]),
            ("[thermal]\nhot_c = nan", &["thermal.cool_c", "NaN"]),
            ("[lamp]\nbuzer = 'x'", &["buzer", "did you mean `buzzer`?"]),
            ("[store]\nmin_free_mib = -1", &["-1", "expected u64"]),
            ("[models]\nmasks = ['a']", &["masks", "did you mean `mask`?"]),
            ("[models]\ndepth = ['a']", &["depth", "string"]),
            ("[source]\nkind = 'camera'", &["camera", "`replay`", "`cameras`"]),
            ("[source]\nkind = 'replay'\nsesion = 'x'", &["sesion", "did you mean `session`?"]),
            ("[source]\nkind = 'synthetic'\nplants = -1", &["-1", "expected u16"]),
            ("[store", &["line 1"]),
            ("\u{0}", &["line 1"]),
        ] {
            let message = read(text).unwrap_err();
            assert!(parts.iter().all(|part| message.contains(part)), "{text}: {message}");
        }
        assert!(!read("[harvester]").unwrap_err().contains("did you mean"));
        assert!(read(&format!("a = {}", "[".repeat(100_000))).is_err());
        assert!(read(&"#".repeat(MAX_BYTES as usize + 1)).unwrap_err().contains("at most"));
        assert!(Config::load(Some(Path::new("/no/such/file.toml"))).unwrap_err().to_string().contains("/no/such"));
    }
}
