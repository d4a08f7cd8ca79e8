//! What the end-to-end tests in `tests/tests` share: where the project stands and the contract of its JSON output.

use std::path::{Path, PathBuf};

use serde_json::Value;

/// The project's root folder.
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .parent()
        .expect("the tests crate stands one folder below the root")
        .to_path_buf()
}

/// A path under `../shared`, the real data beside a development checkout, or `None` where that folder is absent. A
/// caller that gets `None` has been announced as skipped; a path missing inside an existing folder is a failure.
pub fn shared(test: &str, path: &str) -> Option<PathBuf> {
    let shared = root().join("../shared");
    if !shared.is_dir() {
        eprintln!("{test}: skipped, ../shared is absent");
        return None;
    }
    let path = shared.join(path);
    assert!(path.exists(), "{test}: {} does not exist", path.display());
    Some(path)
}

/// The frozen contract of every `--json` output, `docs/plant.schema.json`, as a document.
pub fn schema_document() -> Value {
    serde_json::from_str(include_str!("../../docs/plant.schema.json")).expect("the contract is JSON")
}

/// The same contract, compiled.
pub fn schema() -> jsonschema::Validator {
    jsonschema::validator_for(&schema_document()).expect("the contract is a valid JSON schema")
}
