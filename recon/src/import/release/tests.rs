//! Torch archives made by hand: good ones are read, hostile ones refused.

use std::io::{Cursor, Write};

use proptest::prelude::*;
use zip::ZipWriter;
use zip::write::SimpleFileOptions;

use super::ReleaseError;
use super::archive::Archive;
use super::pickle::Pickle;

/// `[[1, 2, 3], [4, 5, 6]]` as torch would write it: stored column by column.
fn archive() -> Vec<u8> {
    zipped(&pickled([2, 3], [1, 2]), &[1.0, 4.0, 2.0, 5.0, 3.0, 6.0])
}

fn zipped(pickle: &[u8], numbers: &[f32]) -> Vec<u8> {
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    let storage: Vec<u8> = numbers.iter().flat_map(|x| x.to_le_bytes()).collect();
    for (name, content) in [("a/data.pkl", pickle), ("a/data/0", &storage)] {
        zip.start_file(name, SimpleFileOptions::default()).expect("starts");
        zip.write_all(content).expect("writes");
    }
    zip.finish().expect("finishes").into_inner()
}

/// An ordered dictionary with the tensor `x` of that shape and those strides in storage 0.
fn pickled(shape: [u8; 2], strides: [u8; 2]) -> Vec<u8> {
    let text = |text: &str| [&[b'X', text.len() as u8, 0, 0, 0], text.as_bytes()].concat();
    let pair = |[a, b]: [u8; 2]| vec![b'K', a, b'K', b, 0x86];
    [
        b"\x80\x02ccollections\nOrderedDict\n)R(".to_vec(),
        text("x"),
        b"ctorch._utils\n_rebuild_tensor_v2\n((".to_vec(),
        text("storage"),
        b"ctorch\nFloatStorage\n".to_vec(),
        [text("0"), text("cpu"), b"K\x06tQK\x00".to_vec()].concat(),
        pair(shape),
        pair(strides),
        b"\x89ccollections\nOrderedDict\n)RtRu.".to_vec(),
    ]
    .concat()
}

#[test]
fn strides_are_followed_and_sizes_named() {
    let archive = Archive::read("x.pth", &archive()).expect("reads");
    assert_eq!(archive.names(), ["x"]);
    assert_eq!(archive.numbers("x", 6), Ok([1.0, 2.0, 3.0, 4.0, 5.0, 6.0].as_slice()));
    let error = archive.numbers("x", 7).expect_err("six numbers");
    assert_eq!(error, ReleaseError::Size { file: "x.pth".into(), tensor: "x".into(), expected: 7, found: 6 });
}

#[test]
fn pickles_that_want_much_get_an_error() {
    let refused = |bytes: &[u8]| Pickle::read(bytes).expect_err("hostile").to_string();
    // A text of 4 GB, a mark that is not there, a value never remembered, a call of what is none, an end too soon.
    assert!(refused(b"\x80\x02X\xff\xff\xff\xff").contains("byte 2: expected more bytes"));
    assert!(refused(b"t.").contains("byte 0: expected a mark"));
    assert!(refused(b"j\x01\x00\x00\x00.").contains("nothing under 1"));
    assert!(refused(b"NNNs.").contains("expected a dictionary"));
    assert!(refused(b"\x80\x04\x95.").contains("found 0x95"));
    assert!(refused(b"").contains("byte 0"));
    // Code to run is a name among names.
    assert!(Pickle::read(b"cos\nsystem\nX\x02\x00\x00\x00ls\x85R.").is_ok());
    // Each value holds the last one twice: 2^100000 values if they were copied.
    let doubling = [b"N".to_vec(), b"q\x00h\x00\x86".repeat(100_000), b".".to_vec()].concat();
    assert!(Pickle::read(&doubling).is_ok());
    // Nested 100,000 deep, and 100,000 marks.
    assert!(Pickle::read(&[b"N".to_vec(), b"\x85".repeat(100_000), b".".to_vec()].concat()).is_ok());
    assert!(Pickle::read(&[b"(".repeat(100_000), b".".to_vec()].concat()).is_err());
}

#[test]
fn tensors_that_want_much_get_an_error() {
    for (shape, strides) in [([255, 255], [255, 1]), ([2, 3], [255, 255]), ([2, 4], [1, 2])] {
        let error = Archive::read("x", &zipped(&pickled(shape, strides), &[0.0; 6])).expect_err("too few numbers");
        assert!(matches!(error, ReleaseError::Tensor { .. }), "{error}");
    }
    // No step at all: all numbers are the first.
    let same = Archive::read("x", &zipped(&pickled([200, 200], [0, 0]), &[7.0])).expect("reads");
    assert!(same.numbers("x", 40_000).expect("all").iter().all(|x| *x == 7.0));
    assert!(Archive::read("x", &zipped(&pickled([1, 1], [1, 1]), &[f32::NAN])).is_err());
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 512, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn no_bytes_harm(at in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6), cut in any::<prop::sample::Index>()) {
        let mut bytes = archive();
        let mut pickle = pickled([2, 3], [1, 2]);
        for (index, byte) in &at {
            *index.get_mut(&mut bytes) = *byte;
            *index.get_mut(&mut pickle) = *byte;
        }
        for bytes in [&bytes, &bytes[..cut.index(bytes.len())], &zipped(&pickle, &[0.5; 6])] {
            if let Ok(archive) = Archive::read("x", bytes) {
                prop_assert!(archive.names().len() <= bytes.len());
            }
        }
    }

    #[test]
    fn no_program_harms(bytes in prop::collection::vec(prop::sample::select(b"\x80.(NGJKMX)\x85\x86\x87t]}aescuRbQqrhj\x00\x01\n".to_vec()), 0..200)) {
        if let Ok(pickle) = Pickle::read(&bytes) {
            prop_assert!(pickle.entries().len() <= bytes.len());
        }
    }
}
