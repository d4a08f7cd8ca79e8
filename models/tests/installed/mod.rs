//! Small graphs of other people's layouts (tests/fixtures/make.py), installed as a user would.

use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

use demeter_models::{Candidate, Layout, ModelError, Runtime};
use tempfile::TempDir;

pub(crate) const ONE: NonZeroUsize = NonZeroUsize::MIN;

pub(crate) fn runtime() -> Runtime {
    Runtime::load(None).unwrap()
}

pub(crate) fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("tests/fixtures/{name}.onnx"))
}

pub(crate) fn examine(name: &str, layout: Option<Layout>) -> Result<Candidate, ModelError> {
    Candidate::examine(&runtime(), &fixture(name), layout)
}

/// The manifest of an installed fixture, in a folder that goes with the first.
pub(crate) fn installed(name: &str, layout: Option<Layout>) -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = examine(name, layout).unwrap().install(folder.path(), false).unwrap();
    (folder, path)
}
