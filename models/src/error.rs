use std::path::PathBuf;

/// Why a model could not be opened or did not give a usable answer.
#[derive(Debug, thiserror::Error)]
pub enum ModelError {
    /// No manifest of that name in any of the places looked at.
    #[error("model {name}: no {name}.toml in {}; set DEMETER_MODELS to the folder that holds it", list(.tried))]
    Missing {
        /// The model's name.
        name: String,
        /// Folders looked at, in order.
        tried: Vec<PathBuf>,
    },
    /// A file could not be read.
    #[error("{path}: {source}", path = path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The manifest is not TOML, or a key is missing, unknown or of the wrong type; the message names it.
    #[error("{path}: {source}", path = path.display())]
    Manifest {
        /// The manifest.
        path: PathBuf,
        /// Position and reason.
        source: Box<toml::de::Error>,
    },
    /// The model file is larger than any model we accept.
    #[error("{path}: expected at most {expected} bytes, found {found}", path = path.display())]
    TooLarge {
        /// The model file.
        path: PathBuf,
        /// The bound, bytes.
        expected: u64,
        /// Its size, bytes (at least).
        found: u64,
    },
    /// The model file is not the one its manifest describes.
    #[error("{path}: expected sha256 {expected}, found {found}", path = path.display())]
    Sha256 {
        /// The model file.
        path: PathBuf,
        /// The manifest's value.
        expected: String,
        /// The file's value.
        found: String,
    },
    /// The bytes are not an ONNX message: cut off, or something else altogether.
    #[error("{path}: expected an ONNX file, found malformed data at byte {offset}", path = path.display())]
    Malformed {
        /// The model file.
        path: PathBuf,
        /// Where reading failed.
        offset: usize,
    },
    /// Weights are kept in other files, which no sha256 covers.
    #[error("{path}: tensor {tensor:?} keeps its data in another file; expected all data inside", path = path.display())]
    ExternalData {
        /// The model file.
        path: PathBuf,
        /// The tensor's name.
        tensor: String,
    },
    /// The session's inputs or outputs differ from the manifest's, or the manifest's from what the layout needs.
    #[error("model {name}: expected {expected}, found {found}")]
    Ports {
        /// The model's name.
        name: String,
        /// What was promised.
        expected: String,
        /// What is there.
        found: String,
    },
    /// A graph is not of the layout that its manifest or its user says.
    #[error("layout {layout}: expected {expected}, found {found}")]
    Layout {
        /// The layout.
        layout: crate::Layout,
        /// Its inputs and outputs.
        expected: String,
        /// The graph's.
        found: String,
    },
    /// ONNX Runtime refused the model or failed to run it.
    #[error("model {name}: ONNX Runtime: {message}")]
    Session {
        /// The model's name.
        name: String,
        /// What it said.
        message: String,
    },
    /// An output has elements of a type that no layout uses.
    #[error("model {name}: output {output}: expected f32 or i64, found {found}")]
    ElementType {
        /// The model's name.
        name: String,
        /// The output.
        output: String,
        /// Its type as ONNX Runtime spells it.
        found: String,
    },
    /// An output has another shape than the input asks for.
    #[error("model {name}: output {output}: expected shape {expected:?}, found {found:?}")]
    Shape {
        /// The model's name.
        name: String,
        /// The output.
        output: String,
        /// The shape that the input and the layout ask for; -1 for any length.
        expected: Vec<i64>,
        /// The shape that came.
        found: Vec<usize>,
    },
    /// An output holds a NaN or an infinity.
    #[error("model {name}: output {output}: expected finite numbers, found {found} at element {index}")]
    NotFinite {
        /// The model's name.
        name: String,
        /// The output.
        output: String,
        /// The offending value.
        found: f32,
        /// Its place in row-major order.
        index: usize,
    },
    /// The ports of a file are those of no layout.
    #[error("{path}: expected the inputs and outputs of a known layout, found {found}; --layout says which is meant",
        path = path.display())]
    Unrecognised {
        /// The file.
        path: PathBuf,
        /// Its inputs and outputs.
        found: String,
    },
    /// A name that could be another place's.
    #[error(
        "model name: expected letters, digits, `-`, `_` and `.`, beginning with a letter or digit, found {found:?}"
    )]
    Name {
        /// The name.
        found: String,
    },
    /// Something else is installed under this name.
    #[error("{path}: expected nothing or the same, found another; --replace puts the new one in its place",
        path = path.display())]
    Exists {
        /// The file that is there.
        path: PathBuf,
    },
    /// A detector without one class that is an organ.
    #[error("model {name}: expected `classes` to say which of its classes are organs, found none; --classes says it")]
    Classes {
        /// The model's name.
        name: String,
    },
    /// The image has no pixels.
    #[error("image: expected at least 1 x 1 pixels, found {width} x {height}")]
    EmptyImage {
        /// Its width.
        width: u32,
        /// Its height.
        height: u32,
    },
    /// A working size outside what the network is made for.
    #[error("long side: expected a multiple of 16 from 16 to 2048 pixels, found {found}")]
    LongSide {
        /// What was asked for.
        found: u32,
    },
}

/// Paths as one readable line.
pub(crate) fn list(paths: &[PathBuf]) -> String {
    paths.iter().map(|path| path.display().to_string()).collect::<Vec<_>>().join(", ")
}
