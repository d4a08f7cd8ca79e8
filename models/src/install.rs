use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

use demeter_frame::Semantic;

use crate::model::{parse, port, read_bounded, sha256};
use crate::signature::lines;
use crate::{Layout, Manifest, ModelError, Port, Runtime};

/// Characters of the sha256 that stand for a version where a file tells none.
const SHORT: usize = 8;

/// A file that may be installed: read, found to be one whole model without outside data, its layout known.
#[derive(Debug)]
pub struct Candidate {
    /// What will be written beside it; its classes are those of the file's own names of them, where it has such.
    pub manifest: Manifest,
    bytes: Vec<u8>,
}

impl Candidate {
    /// Examines a file, of this layout or of the one that its ports are of.
    ///
    /// # Errors
    /// [`ModelError`]: a file that cannot be read, is too large or no model, keeps data outside, or has ports of no
    /// layout or not of the one said.
    pub fn examine(runtime: &Runtime, file: &Path, layout: Option<Layout>) -> Result<Self, ModelError> {
        let bytes = read_bounded(file)?;
        let session = parse(runtime, file, &bytes, NonZeroUsize::MIN)?;
        let inputs: Vec<Port> = session.inputs().iter().map(port).collect();
        let outputs: Vec<Port> = session.outputs().iter().map(port).collect();
        let unrecognised = || ModelError::Unrecognised { path: file.into(), found: lines(&inputs, &outputs) };
        let layout = layout.or_else(|| Layout::recognise(&inputs, &outputs)).ok_or_else(unrecognised)?;
        layout.roles(&inputs, &outputs)?;
        // Metadata are for people: a file without them is as good.
        let names = session.metadata().ok().and_then(|metadata| metadata.custom("names"));
        let sha256 = sha256(&bytes);
        let manifest = Manifest {
            name: file.file_stem().unwrap_or_default().to_string_lossy().into_owned(),
            version: sha256[..SHORT].to_owned(),
            layout,
            sha256,
            normalisation: "by the layout's adapter".into(),
            source: Some(format!("installed from {}", file.display())),
            classes: names.map(|names| organs(&names)).unwrap_or_default(),
            inputs,
            outputs,
            provenance: None,
        };
        Ok(Self { manifest, bytes })
    }

    /// Writes the model and its manifest into a folder, each whole or not at all; gives the manifest's path. What is
    /// there already stays unless `replace`.
    ///
    /// # Errors
    /// [`ModelError::Name`], [`ModelError::Exists`] when there is another of this name, and [`ModelError::Io`].
    pub fn install(&self, folder: &Path, replace: bool) -> Result<PathBuf, ModelError> {
        let name = &self.manifest.name;
        let plain = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
        if !(name.starts_with(|c: char| c.is_ascii_alphanumeric()) && name.chars().all(plain)) {
            return Err(ModelError::Name { found: name.clone() });
        }
        let text = toml::to_string(&self.manifest)
            .map_err(|error| ModelError::Session { name: name.clone(), message: error.to_string() })?;
        let manifest = folder.join(format!("{name}.toml"));
        let model = folder.join(format!("{name}.onnx"));
        for (path, new) in [(&model, &self.bytes[..]), (&manifest, text.as_bytes())] {
            if !replace && path.exists() && std::fs::read(path).map_err(io(path))? != new {
                return Err(ModelError::Exists { path: path.clone() });
            }
        }
        std::fs::create_dir_all(folder).map_err(io(folder))?;
        // The manifest comes last: a model without one is not looked at.
        for (path, new) in [(&model, &self.bytes[..]), (&manifest, text.as_bytes())] {
            let part = path.with_extension("part");
            std::fs::write(&part, new).map_err(io(&part))?;
            std::fs::rename(&part, path).map_err(io(path))?;
        }
        Ok(manifest)
    }
}

fn io(path: &Path) -> impl Fn(std::io::Error) -> ModelError {
    move |source| ModelError::Io { path: path.into(), source }
}

/// The organs that a file's own names of its classes mean, as ultralytics writes them: `{0: 'leaf', 1: 'stem'}`.
fn organs(names: &str) -> Vec<Semantic> {
    let mut organs = Vec::new();
    let pairs = names.trim_matches(['{', '}']).split(',').filter_map(|pair| pair.split_once(':'));
    for (number, name) in pairs {
        let name = name.trim().trim_matches(['\'', '"']).to_lowercase();
        let has = |words: &[&str]| words.iter().any(|word| name.contains(word));
        let organ = match () {
            () if has(&["main"]) && has(&["stem"]) => Semantic::MainStem,
            () if has(&["stem", "petiole", "branch"]) => Semantic::Stem,
            () if has(&["leaf", "leaves", "blade"]) => Semantic::Leaf,
            () => Semantic::Background,
        };
        // They come in order from 0; where they do not, the user has to say.
        if number.trim().parse() != Ok(organs.len()) {
            return Vec::new();
        }
        organs.push(organ);
    }
    if organs.iter().all(|&organ| organ == Semantic::Background) { Vec::new() } else { organs }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_become_organs_where_they_are_any() {
        use Semantic::{Background, Leaf, MainStem, Stem};
        assert_eq!(organs("{0: 'leaf', 1: 'petiole', 2: 'Main stem', 3: 'pot'}"), [Leaf, Stem, MainStem, Background]);
        for none in ["", "{}", "{0: 'person', 1: 'bicycle'}", "{1: 'leaf'}", "leaf", "{0: 'leaf', 2: 'stem'}"] {
            assert_eq!(organs(none), [], "{none}");
        }
    }
}
