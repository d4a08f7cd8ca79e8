//! What the end-to-end tests in `tests/tests` share: where the project stands and the contract of its JSON output.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde_json::Value;

pub mod lab;

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

/// The program, as built beside these tests.
pub fn demeter() -> std::process::Command {
    std::process::Command::new(demeter_path())
}

/// The program's file.
///
/// # Panics
/// When it is not there: a workspace build makes it, a build of this crate alone does not.
pub fn demeter_path() -> PathBuf {
    let tests = std::env::current_exe().expect("a test runs from a file");
    let program = tests.ancestors().nth(2).expect("tests stand in target/PROFILE/deps").join("demeter");
    assert!(program.is_file(), "{} does not exist: run `cargo build -p demeter`", program.display());
    program
}

/// Runs the program with --json; its exit code and its answer, checked against the contract.
///
/// # Panics
/// When the answer is no JSON or breaks the contract.
pub fn answer(arguments: &[&str]) -> (Option<i32>, Value) {
    let output = demeter().args(arguments).arg("--json").output().expect("the program starts");
    let answer = serde_json::from_slice(&output.stdout).unwrap_or_else(|error| {
        panic!("{arguments:?}: {error}: {}: {}", output.status, String::from_utf8_lossy(&output.stderr))
    });
    if let Err(error) = schema().validate(&answer) {
        panic!("{arguments:?}: {error}");
    }
    (output.status.code(), answer)
}

/// The values of traits that a record alone gives again: a fit says besides how sure it is and which blades it saw.
///
/// # Panics
/// When a value is no number.
pub fn recorded(traits: &Value) -> BTreeMap<&str, f64> {
    let traits = traits.as_object().expect("traits are an object").iter();
    let kept = traits.filter(|(key, _)| key.as_str() != "blade_count_visible");
    kept.map(|(key, quantity)| (key.as_str(), quantity["value"].as_f64().expect("a number"))).collect()
}
