//! Adapters on graphs whose answers are known: every number before and after the network, not only shapes.
#![allow(clippy::unwrap_used, missing_docs)]

mod installed;
mod pictures;

use demeter_frame::{Rgb, Semantic};
use demeter_models::{DepthMap, DepthNetwork, Instance, Layout, Manifest, OrganNetwork, SamDecoder, SamEncoder, U2net};
use installed::{ONE, examine, installed, runtime};
use pictures::ramps;

fn depth(name: &str, layout: Option<Layout>, image: &Rgb) -> DepthMap {
    let (_folder, path) = installed(name, layout);
    DepthNetwork::open(&runtime(), &path, ONE).unwrap().run(image).unwrap()
}

/// The organs of a detector, `classes` in place of the manifest's own where there are any.
fn organs(name: &str, classes: &[Semantic], image: &Rgb) -> Vec<Instance> {
    let folder = tempfile::tempdir().unwrap();
    let mut candidate = examine(name, None).unwrap();
    if !classes.is_empty() {
        candidate.manifest.classes = classes.to_vec();
    }
    let path = candidate.install(folder.path(), false).unwrap();
    OrganNetwork::open(&runtime(), &path, ONE).unwrap().run(image).unwrap()
}

/// Red to the right of a column, the rest blue.
fn halves(width: u32, height: u32, column: u32) -> Rgb {
    Rgb::from_fn(width, height, |x, _| image::Rgb(if x >= column { [255, 0, 0] } else { [0, 0, 255] }))
}

#[test]
fn every_layout_is_recognised_and_no_other() {
    for (name, layout) in [
        ("depth_anything", Layout::DepthAnything),
        ("meter", Layout::Meter),
        ("torchvision_mask_rcnn", Layout::TorchvisionMaskRcnn),
        ("detectron2_mask_rcnn", Layout::Detectron2MaskRcnn),
        ("yolo_seg", Layout::YoloSeg),
        ("yolo_seg_nms", Layout::YoloSegNms),
        ("sam_encoder", Layout::SamEncoder),
        ("sam_encoder_hwc", Layout::SamEncoder),
        ("sam_decoder", Layout::SamDecoder),
        ("sam2_encoder", Layout::Sam2Encoder),
        ("sam2_decoder", Layout::Sam2Decoder),
        ("u2netp", Layout::U2net),
    ] {
        let manifest = examine(name, None).unwrap().manifest;
        assert_eq!(manifest.layout, layout, "{name}");
        // What was written is what is read.
        let (_folder, path) = installed(name, None);
        let read = Manifest::read(&path).unwrap();
        assert_eq!(read, manifest, "{name}");
    }
}

#[test]
fn depth_anything_sees_imagenets_colours_and_multiples_of_14() {
    for (width, height) in [(640, 480), (300, 400), (31, 17)] {
        let image = ramps(width, height);
        let map = depth("depth_anything", None, &image);
        let DepthMap::RelativeInverse(inverse) = &map else { panic!("{map:?}") };
        assert_eq!(inverse.dimensions(), (width, height));
        let metric = depth("depth_anything", Some(Layout::DepthAnythingMetric), &image);
        assert_eq!(metric, DepthMap::Metric(inverse.clone()));
        // Away from the border and the pattern's breaks the two resizings keep the ramps.
        let smooth = Rgb::from_fn(width, height, |x, y| {
            let mut pixel = *image.get_pixel(x, y);
            pixel.0[2] = 100;
            pixel
        });
        let DepthMap::RelativeInverse(found) = depth("depth_anything", None, &smooth) else { panic!("not relative") };
        for (x, y, value) in
            found.enumerate_pixels().filter(|(x, y, _)| (4..width - 4).contains(x) && (4..height - 4).contains(y))
        {
            let expected = smooth.get_pixel(x, y).0.iter().map(|&v| f32::from(v)).sum::<f32>() / 3.0 / 255.0;
            assert!((value.0[0] - expected).abs() < 0.01, "{x}, {y}: {} {expected}", value.0[0]);
        }
    }
}

#[test]
fn logarithms_of_depth_fall_with_inverse_depth_and_end_at_the_sky() {
    let DepthMap::RelativeInverse(inverse) = depth("depth_anything", None, &ramps(60, 60)) else { panic!() };
    let most = inverse.iter().copied().fold(0.0, f32::max);
    let log = DepthMap::RelativeInverse(inverse.clone()).log_depth();
    for (log, inverse) in log.iter().zip(inverse.iter()) {
        assert!((log + inverse.max(0.02 * most).ln()).abs() < 1e-6);
    }
    let metres = DepthMap::Metric(inverse).log_depth();
    assert!(metres.iter().any(|log| log.is_finite()));
    let nothing = DepthMap::RelativeInverse(demeter_frame::Depth::new(2, 2)).log_depth();
    assert!(nothing.iter().all(|log| log.is_nan()));
}

#[test]
fn meter_gives_metres() {
    let DepthMap::Metric(metres) = depth("meter", None, &ramps(512, 384)) else { panic!("not metric") };
    for (x, _, value) in metres.enumerate_pixels().filter(|(x, ..)| (16..496).contains(x)) {
        let expected = 10.0 * x as f32 / 511.0;
        assert!((value.0[0] - expected).abs() < 0.05, "{x}: {} {expected}", value.0[0]);
    }
}

#[test]
fn torchvisions_masks_lie_in_the_picture_and_classes_are_mapped() {
    let classes = [Semantic::Background, Semantic::Leaf, Semantic::Stem];
    // Red from column 8 on, green nowhere: of the two sure things only the less sure has a mask.
    let image = halves(16, 10, 8);
    let found = organs("torchvision_mask_rcnn", &classes, &image);
    let [leaf] = &found[..] else { panic!("{found:?}") };
    assert_eq!((leaf.organ, leaf.score), (Semantic::Leaf, 0.6));
    // The box is 4..12, 2..8, and a pixel around it.
    assert!(leaf.pixels().all(|(x, y)| (8..13).contains(&x) && (1..9).contains(&y)));
    assert_eq!(leaf.pixels().count(), 5 * 8);
    let green = Rgb::from_pixel(16, 10, image::Rgb([0, 255, 0]));
    let found = organs("torchvision_mask_rcnn", &classes, &green);
    assert_eq!(found.iter().map(|f| f.organ).collect::<Vec<_>>(), [Semantic::Stem]);
    // What is no organ is not found.
    let only_leaves = [Semantic::Background, Semantic::Leaf];
    assert_eq!(organs("torchvision_mask_rcnn", &only_leaves, &green), []);
}

#[test]
fn detectron2s_masks_are_pasted_into_boxes_of_the_resized_picture() {
    let blue = |b| Rgb::from_pixel(60, 40, image::Rgb([255, 0, b]));
    let found = organs("detectron2_mask_rcnn", &[Semantic::Leaf], &blue(204));
    let [leaf] = &found[..] else { panic!("{found:?}") };
    // Blue comes first, in 0..=255.
    assert!((leaf.score - 0.8).abs() < 1e-6);
    // The left half of the middle half.
    let pixels: Vec<_> = leaf.pixels().collect();
    assert!(pixels.iter().all(|&(x, y)| (15..30).contains(&x) && (10..30).contains(&y)), "{:?}", leaf.at);
    // bilinear at the box's border meets nothing outside: half a mask's cell, less than half a pixel, may be lost.
    assert_eq!(pixels.len(), 15 * 20);
    assert_eq!(organs("detectron2_mask_rcnn", &[Semantic::Leaf], &blue(100)), []);
}

#[test]
fn yolos_boxes_are_suppressed_and_its_masks_led_back_through_the_frame() {
    // The network's picture is this one doubled, 160 rows of grey above and below.
    let image = halves(320, 160, 160);
    let found = organs("yolo_seg", &[], &image);
    let [leaf, petiole] = &found[..] else { panic!("{} found", found.len()) };
    assert_eq!((leaf.organ, leaf.score), (Semantic::Leaf, 0.9));
    assert_eq!((petiole.organ, petiole.score), (Semantic::Stem, 0.7));
    // The box is 80..240, 40..120 in this picture; red begins at column 160.
    let extent = |organ: &Instance| {
        let pixels: Vec<_> = organ.pixels().collect();
        let (xs, ys) = (pixels.iter().map(|p| p.0), pixels.iter().map(|p| p.1));
        (xs.clone().min(), xs.max(), ys.clone().min(), ys.max(), pixels.len())
    };
    assert_eq!(extent(leaf), (Some(160), Some(239), Some(40), Some(119), 80 * 80));
    assert_eq!(extent(petiole), (Some(80), Some(159), Some(40), Some(119), 80 * 80));
    // The graph with suppression inside says the same.
    assert_eq!(organs("yolo_seg_nms", &[], &image), found);
    // The file's names say what is what unless the manifest does.
    let only_stems = organs("yolo_seg", &[Semantic::Background, Semantic::Stem], &image);
    assert_eq!(only_stems, std::slice::from_ref(petiole));
}

#[test]
fn sam_cuts_out_what_is_at_the_point() {
    for (encoder, decoder) in
        [("sam_encoder", "sam_decoder"), ("sam_encoder_hwc", "sam_decoder"), ("sam2_encoder", "sam2_decoder")]
    {
        let ((_e, encoder), (_d, decoder)) = (installed(encoder, None), installed(decoder, None));
        let mut encoder = SamEncoder::open(&runtime(), &encoder, ONE).unwrap();
        let mut decoder = SamDecoder::open(&runtime(), &decoder, ONE).unwrap();
        let image = Rgb::from_pixel(400, 300, image::Rgb([10, 153, 30]));
        let embedding = encoder.run(&image).unwrap();
        for point in [[100, 20], [333, 299]] {
            let cutout = decoder.run(&embedding, point).unwrap();
            assert_eq!(cutout.mask.dimensions(), (400, 300));
            // The first of the answers is worse, and green in 0..1 is how good the other is.
            assert!((cutout.score - 0.6).abs() < 1e-5, "{}", cutout.score);
            for (x, _, pixel) in cutout.mask.enumerate_pixels().filter(|(x, ..)| x.abs_diff(point[0]) > 1) {
                assert_eq!(pixel.0[0] > 0, x < point[0], "{x}, {point:?}");
            }
        }
        assert!(decoder.run(&decoder.blank(), [5, 5]).is_ok());
    }
}

#[test]
fn u2net_shows_what_stands_out_from_0_to_1() {
    let (_folder, path) = installed("u2netp", None);
    let mut network = U2net::open(&runtime(), &path, ONE).unwrap();
    let mask = network.run(&ramps(640, 400)).unwrap();
    for (x, _, value) in mask.enumerate_pixels().filter(|(x, ..)| (8..632).contains(x)) {
        assert!((value.0[0] - x as f32 / 639.0).abs() < 0.01, "{x}: {}", value.0[0]);
    }
    // A dark picture is as good as a bright one, and one without anything shows nothing.
    let dark = Rgb::from_fn(64, 64, |x, _| image::Rgb([(x / 2) as u8, 0, 0]));
    let mask = network.run(&dark).unwrap();
    assert!(mask.get_pixel(60, 30).0[0] > 0.9 && mask.get_pixel(3, 30).0[0] < 0.1);
    assert!(network.run(&Rgb::from_pixel(50, 50, image::Rgb([90; 3]))).unwrap().iter().all(|&v| v == 0.0));
}
