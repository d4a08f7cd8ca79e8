//! What a model file or a manifest can be wrong in, each with the error that names it.
#![allow(clippy::unwrap_used, missing_docs)]

mod graph;

use std::num::NonZeroUsize;
use std::path::Path;

use demeter_models::{MAX_BYTES, ModelError, Organ2d, Runtime, RuntimeError};
use graph::{Graph, manifest, write};
use tempfile::tempdir;

fn open(path: &Path) -> Result<Organ2d, ModelError> {
    Organ2d::open(&Runtime::load(None).unwrap(), path, NonZeroUsize::MIN)
}

fn open_bytes(onnx: &[u8], manifest: &str) -> Result<Organ2d, ModelError> {
    let folder = tempdir().unwrap();
    open(&write(folder.path(), onnx, manifest))
}

#[test]
fn a_whole_model_opens_and_its_runtime_is_one_a_process() {
    let onnx = Graph::default().onnx();
    let organ2d = open_bytes(&onnx, &manifest(&onnx)).unwrap();
    assert_eq!(organ2d.model().manifest().name, "test");
    let runtime = Runtime::load(None).unwrap();
    assert_eq!(runtime.library(), Runtime::load(Some(runtime.library())).unwrap().library());
    let error = Runtime::load(Some(Path::new("/nowhere/libonnxruntime.so"))).unwrap_err();
    assert!(matches!(error, RuntimeError::AlreadyLoaded { .. }), "{error}");
    assert!(runtime.build_info().contains("ORT"), "{}", runtime.build_info());
}

#[test]
fn sessions_may_move_between_threads() {
    fn is_send<T: Send>() {}
    is_send::<Organ2d>();
}

#[test]
fn every_missing_unknown_or_mistyped_key_is_named() {
    let onnx = Graph::default().onnx();
    let whole = manifest(&onnx);
    for line in whole.lines().filter(|line| line.contains(" = ")) {
        let key = line.split(" = ").next().unwrap();
        let error = open_bytes(&onnx, &whole.replace(line, "")).unwrap_err();
        assert!(matches!(error, ModelError::Manifest { .. }), "{key}: {error}");
        assert!(error.to_string().contains(&format!("missing field `{key}`")), "{key}: {error}");
        let error = open_bytes(&onnx, &whole.replace(line, &format!("{key} = 1979-05-27"))).unwrap_err();
        assert!(matches!(error, ModelError::Manifest { .. }), "{key}: {error}");
    }
    let error = open_bytes(&onnx, &format!("sha512 = 1\n{whole}")).unwrap_err();
    assert!(error.to_string().contains("sha512"), "{error}");
    let error = open_bytes(&onnx, "\u{0}").unwrap_err();
    assert!(matches!(error, ModelError::Manifest { .. }), "{error}");
}

#[test]
fn files_that_are_not_there_are_named() {
    let folder = tempdir().unwrap();
    let error = open(&folder.path().join("test.toml")).unwrap_err();
    assert!(matches!(&error, ModelError::Io { path, .. } if path.ends_with("test.toml")), "{error}");
    let onnx = Graph::default().onnx();
    let path = write(folder.path(), &onnx, &manifest(&onnx));
    std::fs::remove_file(folder.path().join("test.onnx")).unwrap();
    let error = open(&path).unwrap_err();
    assert!(matches!(&error, ModelError::Io { path, .. } if path.ends_with("test.onnx")), "{error}");
}

#[test]
fn any_changed_bit_is_refused_before_parsing() {
    let onnx = Graph::default().onnx();
    let manifest = manifest(&onnx);
    for at in 0..onnx.len() {
        let mut changed = onnx.clone();
        changed[at] ^= 1 << (at % 8);
        let error = open_bytes(&changed, &manifest).unwrap_err();
        assert!(matches!(error, ModelError::Sha256 { .. }), "byte {at}: {error}");
    }
}

#[test]
fn a_truncated_file_is_refused_even_with_its_own_sha256() {
    let onnx = Graph::default().onnx();
    for length in 0..onnx.len() {
        let cut = &onnx[..length];
        let error = open_bytes(cut, &manifest(&onnx)).unwrap_err();
        assert!(matches!(error, ModelError::Sha256 { .. }), "{length} bytes: {error}");
        let error = open_bytes(cut, &manifest(cut)).unwrap_err();
        let typed = matches!(error, ModelError::Malformed { .. } | ModelError::Session { .. });
        assert!(typed, "{length} bytes: {error}");
    }
}

#[test]
fn a_file_above_the_bound_is_refused() {
    let folder = tempdir().unwrap();
    let onnx = Graph::default().onnx();
    let path = write(folder.path(), &onnx, &manifest(&onnx));
    // A sparse file: the length is there, the blocks are not.
    let file = std::fs::File::options().write(true).open(folder.path().join("test.onnx")).unwrap();
    file.set_len(MAX_BYTES + 1).unwrap();
    let error = open(&path).unwrap_err();
    assert!(matches!(error, ModelError::TooLarge { expected: MAX_BYTES, .. }), "{error}");
    file.set_len(MAX_BYTES / 1024).unwrap();
    let error = open(&path).unwrap_err();
    assert!(matches!(error, ModelError::Sha256 { .. }), "{error}");
}

#[test]
fn weights_in_another_file_are_refused_and_the_tensor_named() {
    let onnx = Graph { external: true, ..Graph::default() }.onnx();
    let folder = tempdir().unwrap();
    let path = write(folder.path(), &onnx, &manifest(&onnx));
    std::fs::write(folder.path().join("weights.bin"), [0; 48]).unwrap();
    let error = open(&path).unwrap_err();
    assert!(matches!(&error, ModelError::ExternalData { tensor, .. } if tensor == "sem_weights"), "{error}");
}

#[test]
fn bottomless_nesting_is_refused() {
    // Written inside out: graph in attribute in node in graph, a thousand deep: more than the walk enters and less than a stack holds.
    let mut bytes = Vec::new();
    for field in [6, 5, 1].iter().cycle().take(3000).chain(&[7]) {
        let mut length = bytes.len();
        let mut outer = vec![field << 3 | 2u8];
        while length >= 0x80 {
            outer.push(length as u8 | 0x80);
            length >>= 7;
        }
        outer.push(length as u8);
        bytes = [outer, bytes].concat();
    }
    let error = open_bytes(&bytes, &manifest(&bytes)).unwrap_err();
    assert!(matches!(error, ModelError::Malformed { .. }), "{error}");
}

#[test]
fn ports_other_than_promised_are_refused_with_both() {
    let five = Graph { sem: vec![[0.0; 3]; 5], ..Graph::default() }.onnx();
    let error = open_bytes(&five, &manifest(&five)).unwrap_err().to_string();
    assert!(error.contains("sem f32[-1, 4, -1, -1]") && error.contains("sem f32[-1, 5, -1, -1]"), "{error}");
    // A manifest that agrees with its five-class graph still is no organ2d.
    let agreeing = manifest(&five).replace("[-1, 4,", "[-1, 5,");
    assert!(matches!(open_bytes(&five, &agreeing).unwrap_err(), ModelError::Ports { .. }));
    let half = Graph { input_type: 10, ..Graph::default() }.onnx();
    let error = open_bytes(&half, &manifest(&half)).unwrap_err();
    assert!(matches!(error, ModelError::Ports { .. } | ModelError::Session { .. }), "{error}");
    let onnx = Graph::default().onnx();
    let error = open_bytes(&onnx, &manifest(&onnx).replace("\"dist\"", "\"distance\"")).unwrap_err();
    assert!(error.to_string().contains("distance"), "{error}");
}
