use std::fmt::Write;
use std::path::{Path, PathBuf};

use demeter_models::{Layout, Manifest, ModelError, find_manifests};
use serde::Serialize;

use crate::error::{CommandError, Exit, chain};
use crate::output::Output;

/// Characters of a sha256 that tell models apart.
const SHORT: usize = 12;

/// What is known of an installed model without opening it.
#[derive(Debug, Serialize)]
pub(super) struct Row {
    name: String,
    version: String,
    layout: Layout,
    sha256: String,
    bytes: u64,
    /// How one of ours was made, or where another's comes from.
    provenance: String,
    manifest: PathBuf,
}

impl Row {
    pub(super) fn read(path: &Path) -> Result<Self, ModelError> {
        let manifest = Manifest::read(path)?;
        let model = Manifest::model_path(path);
        let bytes = std::fs::metadata(&model).map_err(|source| ModelError::Io { path: model, source })?.len();
        let trained = manifest.provenance.map(|provenance| provenance.command);
        Ok(Self {
            name: manifest.name,
            version: manifest.version,
            layout: manifest.layout,
            sha256: manifest.sha256,
            bytes,
            provenance: trained.or(manifest.source).unwrap_or_default(),
            manifest: path.into(),
        })
    }
}

pub(super) fn run(output: &Output) -> Result<Exit, CommandError> {
    let (mut rows, mut exit) = (Vec::new(), Exit::Done);
    for path in find_manifests() {
        match Row::read(&path) {
            Ok(row) => rows.push(row),
            Err(error) => {
                tracing::warn!("{}", chain(&error));
                exit = Exit::Partial;
            }
        }
    }
    if output.json {
        output.json(&serde_json::json!({"models": rows}))?;
        return Ok(exit);
    }
    let mut table =
        format!("{:<24} {:<9} {:<22} {:<SHORT$} {:>8}  provenance\n", "name", "version", "layout", "sha256", "MB");
    for Row { name, version, layout, sha256, bytes, provenance, .. } in &rows {
        let (layout, megabytes) = (layout.to_string(), *bytes as f64 / 1e6);
        let short = sha256.get(..SHORT).unwrap_or(sha256);
        // Writing to a String cannot fail.
        writeln!(table, "{name:<24} {version:<9} {layout:<22} {short:<SHORT$} {megabytes:>8.1}  {provenance}")
            .unwrap_or_default();
    }
    output.text(&table)?;
    Ok(exit)
}
