use demeter_frame::{Calibration, CameraError, CameraId, Distortion, Intrinsics, Pose};
use serde::{Deserialize, Serialize};

/// The version of the session format this program writes, and the newest it reads.
pub const SCHEMA_VERSION: u32 = 1;

/// The farthest a camera is from the antenna on its rig, metres each way: a guess beyond the widest boom's half.
pub const LONGEST_ARM: f64 = 20.0;

/// session.toml: what was recorded, with which cameras, along which rows.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// [`SCHEMA_VERSION`].
    pub schema_version: u32,
    /// The rig's name.
    pub rig_id: String,
    /// The session's name; records are named for it.
    pub session_id: String,
    /// The crop: a species the program knows.
    pub species: String,
    /// Where the cameras are from the antenna of the satellite receiver, metres: forwards along the drive, and to the left.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cameras_from_antenna_m: Option<[f64; 2]>,
    /// The rig's cameras, at least one.
    pub cameras: Vec<SessionCamera>,
    /// The rows driven along, in order.
    #[serde(default)]
    pub rows: Vec<Row>,
}

/// A camera of the rig: what it sees, and at least one way to tell where it is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SessionCamera {
    /// Its stable name.
    pub id: CameraId,
    /// Height of its optical centre above the ground, metres.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub height_above_ground_m: Option<f64>,
    /// Its calibration but for the lens.
    pub intrinsics: Intrinsics,
    /// How its lens bends the picture; absent for a pinhole.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub distortion: Option<Distortion>,
    /// Where it is mounted on the rig.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rig_from_camera: Option<Pose>,
}

/// A row of the field.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Row {
    /// The row's name.
    pub row: String,
    /// The plot it belongs to.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub plot: Option<String>,
    /// Distance from plant to plant as sown, metres.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub plant_spacing_m: Option<f64>,
}

/// What is wrong with session.toml.
#[derive(Debug, thiserror::Error)]
pub enum ManifestError {
    /// Not text.
    #[error("expected UTF-8 text, found a byte that is not at {found}")]
    Utf8 {
        /// Offset of the first bad byte.
        found: usize,
    },
    /// Not TOML, a key missing, unknown or of another type; the message names the line, the key and what was expected.
    #[error(transparent)]
    Toml(#[from] Box<toml::de::Error>),
    /// Cannot be written as TOML.
    #[error(transparent)]
    Write(#[from] Box<toml::ser::Error>),
    /// Written by a newer program.
    #[error("schema_version: expected at most {expected}, found {found}; a newer program wrote this session")]
    Newer {
        /// [`SCHEMA_VERSION`].
        expected: u32,
        /// The file's.
        found: u32,
    },
    /// A value that parses and makes no sense.
    #[error("{key}: expected {expected}, found {found}")]
    Value {
        /// The key, from the top of the file.
        key: String,
        /// What belongs there.
        expected: &'static str,
        /// What stands there.
        found: String,
    },
    /// A calibration that no camera has.
    #[error("{key}")]
    Camera {
        /// The key, from the top of the file.
        key: String,
        /// Which number.
        source: CameraError,
    },
}

impl Manifest {
    /// Reads and checks session.toml.
    ///
    /// # Errors
    /// [`ManifestError`]; a newer schema is told apart from a broken file.
    pub fn parse(bytes: &[u8]) -> Result<Self, ManifestError> {
        #[derive(Deserialize)]
        struct Version {
            schema_version: u32,
        }
        let text = std::str::from_utf8(bytes).map_err(|error| ManifestError::Utf8 { found: error.valid_up_to() })?;
        // A newer schema has keys that are unknown here: the version is looked at before they are.
        let Version { schema_version: found } = toml::from_str(text).map_err(Box::new)?;
        if found > SCHEMA_VERSION {
            return Err(ManifestError::Newer { expected: SCHEMA_VERSION, found });
        }
        toml::from_str::<Self>(text).map_err(Box::new)?.validated()
    }

    /// The text of session.toml.
    ///
    /// # Errors
    /// [`ManifestError`] for what [`Manifest::parse`] would refuse.
    pub fn to_toml(&self) -> Result<String, ManifestError> {
        Ok(toml::to_string(&self.clone().validated()?).map_err(Box::new)?)
    }

    /// The camera of that name.
    #[must_use]
    pub fn camera(&self, id: &CameraId) -> Option<&SessionCamera> {
        self.cameras.iter().find(|camera| camera.id == *id)
    }

    fn validated(self) -> Result<Self, ManifestError> {
        if self.schema_version == 0 || self.schema_version > SCHEMA_VERSION {
            return Err(value("schema_version", "1", self.schema_version));
        }
        for (key, id) in [("rig_id", &self.rig_id), ("session_id", &self.session_id), ("species", &self.species)] {
            check_id(key, id)?;
        }
        if self.cameras.is_empty() {
            return Err(value("cameras", "at least one camera", "none"));
        }
        for (i, camera) in self.cameras.iter().enumerate() {
            camera.check(&format!("cameras[{i}]"))?;
            if self.cameras[..i].iter().any(|before| before.id == camera.id) {
                return Err(value(format!("cameras[{i}].id"), "a name of its own", &camera.id));
            }
        }
        if let Some(arm) = self.cameras_from_antenna_m.filter(|arm| !arm.iter().all(|m| m.abs() <= LONGEST_ARM)) {
            return Err(value("cameras_from_antenna_m", "at most 20 metres each way", format!("{arm:?}")));
        }
        for (i, row) in self.rows.iter().enumerate() {
            row.check(&format!("rows[{i}]"))?;
        }
        Ok(self)
    }
}

impl SessionCamera {
    /// The camera with its lens.
    ///
    /// # Errors
    /// [`CameraError`] naming the number that no camera has.
    pub fn calibration(&self) -> Result<Calibration, CameraError> {
        Calibration::new(self.intrinsics, self.distortion)
    }

    fn check(&self, key: &str) -> Result<(), ManifestError> {
        check_id(&format!("{key}.id"), &self.id.0)?;
        self.calibration().map_err(|source| ManifestError::Camera { key: key.to_owned(), source })?;
        if self.rig_from_camera.is_none() && self.height_above_ground_m.is_none() {
            return Err(value(key, "rig_from_camera or height_above_ground_m", "neither"));
        }
        if let Some(pose) = self.rig_from_camera.filter(|pose| !pose.is_valid()) {
            let found = format!("{pose:?}");
            return Err(value(format!("{key}.rig_from_camera"), "a unit quaternion q and a finite t", found));
        }
        is_length(&format!("{key}.height_above_ground_m"), self.height_above_ground_m)
    }
}

impl Row {
    fn check(&self, key: &str) -> Result<(), ManifestError> {
        is_name(&format!("{key}.row"), &self.row)?;
        if let Some(plot) = &self.plot {
            is_name(&format!("{key}.plot"), plot)?;
        }
        is_length(&format!("{key}.plant_spacing_m"), self.plant_spacing_m)
    }
}

/// What [`is_id`] takes, for messages.
pub const ID: &str = "1 to 64 bytes of letters, digits, '-', '_' and '.', not first a '.'";

/// Whether a session takes this for an id. Ids become file names and parts of URLs, so they hold nothing that means
/// something there.
#[must_use]
pub fn is_id(id: &str) -> bool {
    let plain = |c: char| c.is_alphanumeric() || matches!(c, '-' | '_' | '.');
    !id.is_empty() && id.len() <= 64 && !id.starts_with('.') && id.chars().all(plain)
}

fn check_id(key: &str, id: &str) -> Result<(), ManifestError> {
    if is_id(id) { Ok(()) } else { Err(value(key, ID, format!("{id:?}"))) }
}

/// Rows and plots are named by people, who use spaces and slashes.
fn is_name(key: &str, name: &str) -> Result<(), ManifestError> {
    if name.trim().is_empty() || name.len() > 64 || name.chars().any(char::is_control) {
        return Err(value(key, "1 to 64 bytes of text in one line", format!("{name:?}")));
    }
    Ok(())
}

/// Cameras and plants are nearer to each other than 100 m, and neither at the same place.
fn is_length(key: &str, metres: Option<f64>) -> Result<(), ManifestError> {
    match metres {
        Some(m) if !(m > 0.0 && m <= 100.0) => Err(value(key, "metres above 0, at most 100", m)),
        _ => Ok(()),
    }
}

fn value(key: impl Into<String>, expected: &'static str, found: impl ToString) -> ManifestError {
    ManifestError::Value { key: key.into(), expected, found: found.to_string() }
}
