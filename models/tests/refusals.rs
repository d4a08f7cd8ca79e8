//! Other people's models that are not what they seem (spec/reliability.md 30), each with the error that names it.
#![allow(clippy::unwrap_used, missing_docs)]

mod installed;
mod pictures;

use demeter_frame::{Rgb, Semantic};
use demeter_models::{
    Candidate, DepthNetwork, Layout, Manifest, ModelError, OrganNetwork, SamDecoder, SamEncoder, U2net, find_manifest,
};
use installed::{ONE, examine, fixture, installed, runtime};
use pictures::ramps;

#[test]
fn ports_of_no_layout_are_refused_and_said() {
    let error = examine("unknown", None).unwrap_err();
    assert!(matches!(error, ModelError::Unrecognised { .. }), "{error}");
    assert!(error.to_string().contains("logits f32[1, 3]"), "{error}");
    // Force does not make a depth network of a classifier.
    let error = examine("unknown", Some(Layout::Meter)).unwrap_err();
    assert!(matches!(error, ModelError::Layout { layout: Layout::Meter, .. }), "{error}");
    // detectron2's masks are 28 x 28.
    assert!(matches!(examine("detectron2_misshaped", None).unwrap_err(), ModelError::Unrecognised { .. }));
}

#[test]
fn the_wrong_type_is_refused() {
    assert!(matches!(examine("depth_double", None).unwrap_err(), ModelError::Unrecognised { .. }));
    let error = examine("depth_double", Some(Layout::DepthAnything)).unwrap_err();
    assert!(error.to_string().contains("depth f64"), "{error}");
}

#[test]
fn a_layout_may_be_forced_on_ports_of_other_names() {
    assert!(matches!(examine("depth_renamed", None).unwrap_err(), ModelError::Unrecognised { .. }));
    let run = |name| {
        let (_folder, path) = installed(name, Some(Layout::DepthAnythingMetric));
        DepthNetwork::open(&runtime(), &path, ONE).unwrap().run(&ramps(40, 30)).unwrap()
    };
    assert_eq!(run("depth_renamed"), run("depth_anything"));
    // Shapes are not to be forced: u2netp's picture is METER's but for its size.
    assert!(matches!(examine("u2netp", Some(Layout::Meter)).unwrap_err(), ModelError::Layout { .. }));
}

#[test]
fn a_truncated_file_is_refused_at_every_length() {
    let folder = tempfile::tempdir().unwrap();
    let whole = std::fs::read(fixture("depth_anything")).unwrap();
    let path = folder.path().join("cut.onnx");
    for length in 0..whole.len() {
        std::fs::write(&path, &whole[..length]).unwrap();
        let error = Candidate::examine(&runtime(), &path, None).unwrap_err();
        let typed = matches!(
            error,
            ModelError::Malformed { .. } | ModelError::Session { .. } | ModelError::Unrecognised { .. }
        );
        assert!(typed, "{length} bytes: {error}");
    }
}

#[test]
fn an_unlisted_or_changed_file_is_refused() {
    let (_folder, path) = installed("meter", None);
    std::fs::remove_file(&path).unwrap();
    assert!(matches!(DepthNetwork::open(&runtime(), &path, ONE).unwrap_err(), ModelError::Io { .. }));
    assert!(matches!(find_manifest("no such model").unwrap_err(), ModelError::Missing { .. }));
    let (_folder, path) = installed("meter", None);
    std::fs::copy(fixture("depth_anything"), Manifest::model_path(&path)).unwrap();
    assert!(matches!(DepthNetwork::open(&runtime(), &path, ONE).unwrap_err(), ModelError::Sha256 { .. }));
}

#[test]
fn not_a_number_is_an_error() {
    let (_folder, path) = installed("depth_nan", None);
    let error = DepthNetwork::open(&runtime(), &path, ONE).unwrap().run(&ramps(40, 30)).unwrap_err();
    assert!(matches!(error, ModelError::NotFinite { .. }), "{error}");
}

#[test]
fn a_map_of_another_size_is_an_error() {
    let (_folder, path) = installed("depth_misshaped", None);
    let error = DepthNetwork::open(&runtime(), &path, ONE).unwrap().run(&ramps(40, 40)).unwrap_err();
    let ModelError::Shape { expected, found, .. } = error else { panic!("{error}") };
    assert_eq!((expected, found), (vec![1, 518, 518], vec![1, 259, 259]));
}

#[test]
fn a_network_of_another_role_is_refused() {
    let (_m, meter) = installed("meter", None);
    let (_s, sam) = installed("sam_encoder", None);
    let (_d, decoder) = installed("sam2_decoder", None);
    assert!(matches!(OrganNetwork::open(&runtime(), &meter, ONE).unwrap_err(), ModelError::Ports { .. }));
    assert!(matches!(U2net::open(&runtime(), &meter, ONE).unwrap_err(), ModelError::Ports { .. }));
    assert!(matches!(DepthNetwork::open(&runtime(), &sam, ONE).unwrap_err(), ModelError::Ports { .. }));
    // Each kind of SAM has its own decoder.
    let embedding = SamEncoder::open(&runtime(), &sam, ONE).unwrap().run(&ramps(40, 30)).unwrap();
    let error = SamDecoder::open(&runtime(), &decoder, ONE).unwrap().run(&embedding, [1, 1]).unwrap_err();
    assert!(matches!(error, ModelError::Session { .. }), "{error}");
}

#[test]
fn a_detector_without_organs_is_refused() {
    let (folder, path) = installed("torchvision_mask_rcnn", None);
    assert!(matches!(OrganNetwork::open(&runtime(), &path, ONE).unwrap_err(), ModelError::Classes { .. }));
    let mut candidate = examine("torchvision_mask_rcnn", None).unwrap();
    candidate.manifest.classes = vec![Semantic::Background; 3];
    let path = candidate.install(folder.path(), true).unwrap();
    assert!(matches!(OrganNetwork::open(&runtime(), &path, ONE).unwrap_err(), ModelError::Classes { .. }));
}

#[test]
fn an_empty_picture_is_an_error() {
    let (_folder, path) = installed("meter", None);
    let error = DepthNetwork::open(&runtime(), &path, ONE).unwrap().run(&Rgb::new(0, 3)).unwrap_err();
    assert!(matches!(error, ModelError::EmptyImage { width: 0, height: 3 }), "{error}");
}

#[test]
fn nothing_installed_is_overwritten_silently() {
    let (folder, path) = installed("meter", None);
    let before = std::fs::read(&path).unwrap();
    // The same again is no harm.
    examine("meter", None).unwrap().install(folder.path(), false).unwrap();
    let mut other = examine("depth_anything", None).unwrap();
    other.manifest.name = "meter".into();
    let error = other.install(folder.path(), false).unwrap_err();
    assert!(matches!(&error, ModelError::Exists { path } if path.ends_with("meter.onnx")), "{error}");
    assert_eq!(std::fs::read(&path).unwrap(), before);
    other.install(folder.path(), true).unwrap();
    assert_eq!(Manifest::read(&path).unwrap().layout, Layout::DepthAnything);
    for name in ["", ".", "../up", "a/b", "a b"] {
        other.manifest.name = name.into();
        let error = other.install(folder.path(), true).unwrap_err();
        assert!(matches!(error, ModelError::Name { .. }), "{name}: {error}");
    }
}
