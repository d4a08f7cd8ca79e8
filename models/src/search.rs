use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::{Manifest, ModelError};

/// Where packages put models.
const SYSTEM_MODELS: &str = "/usr/share/demeter/models";

/// `relative` under the executable's folder and each folder above it, then under the current folder and each above it.
pub(crate) fn upwards(relative: &str) -> Vec<PathBuf> {
    let executable = std::env::current_exe().ok().and_then(|path| path.parent().map(Path::to_path_buf));
    let mut found = Vec::new();
    for start in [executable, std::env::current_dir().ok()].into_iter().flatten() {
        for folder in start.ancestors().map(|folder| folder.join(relative)) {
            if !found.contains(&folder) {
                found.push(folder);
            }
        }
    }
    found
}

/// The manifest of the model called `name`: in the folder named by DEMETER_MODELS when that is set, else in `models/`
/// beside or above the executable or the current folder, else in /usr/share/demeter/models.
///
/// # Errors
/// [`ModelError::Missing`] with the folders looked at.
pub fn find_manifest(name: &str) -> Result<PathBuf, ModelError> {
    first_manifest(name, folders())
}

/// The manifests of every model that [`find_manifest`] finds, in the order of their names.
#[must_use]
pub fn find_manifests() -> Vec<PathBuf> {
    all_manifests(&folders())
}

fn folders() -> Vec<PathBuf> {
    std::env::var_os("DEMETER_MODELS").filter(|folder| !folder.is_empty()).map_or_else(
        || upwards("models").into_iter().chain([PathBuf::from(SYSTEM_MODELS)]).collect(),
        |folder| vec![PathBuf::from(folder)],
    )
}

fn all_manifests(folders: &[PathBuf]) -> Vec<PathBuf> {
    let mut found = BTreeMap::new();
    for entry in folders.iter().filter_map(|folder| std::fs::read_dir(folder).ok()).flatten().flatten() {
        let path = entry.path();
        // A manifest describes a model beside it; other TOML files may lie there.
        if path.extension().is_some_and(|end| end == "toml") && Manifest::model_path(&path).is_file() {
            found.entry(entry.file_name()).or_insert(path);
        }
    }
    found.into_values().collect()
}

fn first_manifest(name: &str, folders: Vec<PathBuf>) -> Result<PathBuf, ModelError> {
    let found = folders.iter().map(|folder| folder.join(format!("{name}.toml"))).find(|path| path.is_file());
    found.ok_or_else(|| ModelError::Missing { name: name.to_owned(), tried: folders })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_folder_that_has_the_manifest_wins_and_a_miss_lists_all() {
        let (a, b) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        let folders = || vec![a.path().to_path_buf(), b.path().to_path_buf()];
        let error = first_manifest("net", folders()).unwrap_err().to_string();
        assert!(error.contains(&a.path().display().to_string()) && error.contains("DEMETER_MODELS"), "{error}");
        std::fs::write(b.path().join("net.toml"), "").unwrap();
        assert_eq!(first_manifest("net", folders()).unwrap(), b.path().join("net.toml"));
        std::fs::write(a.path().join("net.toml"), "").unwrap();
        assert_eq!(first_manifest("net", folders()).unwrap(), a.path().join("net.toml"));
        // Without its model a manifest is not listed, and of two of a name the first is.
        assert_eq!(all_manifests(&folders()), [] as [PathBuf; 0]);
        for folder in [&a, &b] {
            std::fs::write(folder.path().join("net.onnx"), "").unwrap();
        }
        assert_eq!(all_manifests(&folders()), [a.path().join("net.toml")]);
    }

    #[test]
    fn upwards_goes_through_every_folder_above_the_executable() {
        let folder = std::env::current_exe().unwrap().parent().unwrap().to_path_buf();
        let found = upwards("x");
        assert_eq!(found[0], folder.join("x"));
        assert!(found.contains(&PathBuf::from("/x")));
    }
}
