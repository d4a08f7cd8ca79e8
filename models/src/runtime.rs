use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use ort::environment::Environment;

use crate::error::list;
use crate::search::upwards;

/// Where packages put the library.
const SYSTEM_LIBRARY: &str = "/usr/lib/demeter";
/// Every released name of the library begins so.
const LIBRARY: &str = "libonnxruntime.so";

/// Why ONNX Runtime is not there.
#[derive(Debug, thiserror::Error)]
pub enum RuntimeError {
    /// No library in any of the places looked at.
    #[error(
        "no libonnxruntime.so in {}; run tools/fetch-onnxruntime.sh, or set DEMETER_ONNXRUNTIME to the library",
        list(.tried)
    )]
    Missing {
        /// Files and folders looked at, in order.
        tried: Vec<PathBuf>,
    },
    /// The file is there but is no ONNX Runtime that we can use.
    #[error("{path}: {message}; run tools/fetch-onnxruntime.sh for one that is known to work", path = path.display())]
    Unusable {
        /// The library.
        path: PathBuf,
        /// What the loader said.
        message: String,
    },
    /// A process holds one ONNX Runtime for its life, and it has another.
    #[error("ONNX Runtime: expected {expected}, found {found} already loaded in this process",
        expected = expected.display(), found = found.display())]
    AlreadyLoaded {
        /// The library asked for.
        expected: PathBuf,
        /// The library that is loaded.
        found: PathBuf,
    },
}

/// ONNX Runtime's shared library, loaded; cheap to clone, one a process.
#[derive(Clone, Debug)]
pub struct Runtime {
    pub(crate) environment: Environment,
    library: PathBuf,
}

/// The process's one runtime: ort builds an environment once and never again.
static LOADED: Mutex<Option<Runtime>> = Mutex::new(None);

impl Runtime {
    /// Loads the library at `path`; without one, the library named by DEMETER_ONNXRUNTIME when that is set, else the
    /// first of: beside the executable, in `.cache/onnxruntime/` of a folder above the executable or the current
    /// folder, /usr/lib/demeter. A second call gives the runtime that is loaded.
    ///
    /// # Errors
    /// [`RuntimeError`], whose message says what to run.
    pub fn load(path: Option<&Path>) -> Result<Self, RuntimeError> {
        // A poisoned lock only means that an earlier load panicked; the value is whole either way.
        let mut loaded = LOADED.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(runtime) = loaded.as_ref() {
            return match path {
                Some(path) if path != runtime.library => {
                    Err(RuntimeError::AlreadyLoaded { expected: path.to_path_buf(), found: runtime.library.clone() })
                }
                _ => Ok(runtime.clone()),
            };
        }
        let environment_variable = std::env::var_os("DEMETER_ONNXRUNTIME").filter(|path| !path.is_empty());
        let library = match path.map(Path::to_path_buf).or(environment_variable.map(PathBuf::from)) {
            Some(file) if file.is_file() => file,
            Some(file) => return Err(RuntimeError::Missing { tried: vec![file] }),
            None => first_library(default_folders())?,
        };
        let unusable = |message: String| RuntimeError::Unusable { path: library.clone(), message };
        // Loading from an explicit path returns an error where ort's implicit path panics.
        let environment = ort::init_from(&library)
            .map_err(|error| unusable(error.to_string()))?
            .with_name("demeter")
            .with_telemetry(false)
            .build()
            .map_err(|error| unusable(error.to_string()))?;
        Ok(loaded.insert(Self { environment, library: library.clone() }).clone())
    }

    /// The library that was loaded.
    #[must_use]
    pub fn library(&self) -> &Path {
        &self.library
    }

    /// What the library says of its build: git revision, build type, compiler flags.
    #[must_use]
    pub fn build_info(&self) -> &'static str {
        ort::info()
    }
}

fn default_folders() -> Vec<PathBuf> {
    let executable = std::env::current_exe().ok().and_then(|path| path.parent().map(Path::to_path_buf));
    executable.into_iter().chain(upwards(".cache/onnxruntime")).chain([PathBuf::from(SYSTEM_LIBRARY)]).collect()
}

/// The library in the first folder that has one; of several versions in a folder the last by name.
fn first_library(folders: Vec<PathBuf>) -> Result<PathBuf, RuntimeError> {
    let in_folder = |folder: &PathBuf| {
        let entries = std::fs::read_dir(folder).ok()?;
        let named = |entry: &std::fs::DirEntry| entry.file_name().to_string_lossy().starts_with(LIBRARY);
        entries.flatten().filter(named).map(|entry| entry.path()).filter(|path| path.is_file()).max()
    };
    folders.iter().find_map(in_folder).ok_or(RuntimeError::Missing { tried: folders })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_with_the_library_is_found_and_a_miss_says_what_to_run() {
        let (a, b) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        let folders = || vec![a.path().to_path_buf(), b.path().to_path_buf(), PathBuf::from("/nowhere")];
        let error = first_library(folders()).unwrap_err().to_string();
        assert!(error.contains("tools/fetch-onnxruntime.sh") && error.contains("/nowhere"), "{error}");
        std::fs::write(a.path().join("libother.so"), "").unwrap();
        std::fs::write(b.path().join("libonnxruntime.so.1.31.1"), "").unwrap();
        assert_eq!(first_library(folders()).unwrap(), b.path().join("libonnxruntime.so.1.31.1"));
    }
}
