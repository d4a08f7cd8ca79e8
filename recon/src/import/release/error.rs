use super::pickle::PickleError;

/// Why files are none of the release.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum ReleaseError {
    /// Not a torch archive.
    #[error("{file}: expected a torch archive, found {found}")]
    Archive {
        /// The file.
        file: String,
        /// What is wrong with it.
        found: String,
    },
    /// An archive whose pickle cannot be read.
    #[error("{file}: {source}")]
    Pickle {
        /// The file.
        file: String,
        /// Where and why.
        source: PickleError,
    },
    /// A tensor that is missing or no tensor.
    #[error("{file}: `{tensor}`: expected {expected}, found {found}")]
    Tensor {
        /// The file.
        file: String,
        /// Its name.
        tensor: String,
        /// What it must be.
        expected: &'static str,
        /// What it is.
        found: String,
    },
    /// A tensor of the wrong size.
    #[error("{file}: `{tensor}`: expected {expected} numbers, found {found}")]
    Size {
        /// The file.
        file: String,
        /// Its name.
        tensor: String,
        /// Numbers it must have.
        expected: usize,
        /// Numbers it has.
        found: usize,
    },
    /// A line of a text file that says something else.
    #[error("{file} line {line}: expected {expected}, found `{found}`")]
    Line {
        /// The file.
        file: &'static str,
        /// Counted from 1.
        line: usize,
        /// What each line must be.
        expected: &'static str,
        /// What it is.
        found: String,
    },
    /// Nodes that make no tree.
    #[error("node {node}: expected {expected}, found {found}")]
    Tree {
        /// The node's number in the release.
        node: u32,
        /// What it must have.
        expected: &'static str,
        /// What it has.
        found: String,
    },
}

impl ReleaseError {
    pub(super) fn tensor(file: &str, tensor: &str, expected: &'static str, found: impl Into<String>) -> Self {
        Self::Tensor { file: file.into(), tensor: tensor.into(), expected, found: found.into() }
    }
}
