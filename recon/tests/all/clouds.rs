//! Reading and writing PLY clouds.

use crate::common::shared;
use demeter_recon::cloud::{PointCloud, PointOrgan, diagonal};
use demeter_recon::export::cloud_to_ply;
use demeter_recon::import::{MAX_POINTS, PlyError};
use demeter_recon::model::OrganKind;
use glam::DVec3;
use proptest::prelude::*;

fn clouds() -> impl Strategy<Value = PointCloud> {
    let number = prop_oneof![-1e3..1e3_f64, any::<f64>().prop_filter("finite", |x| x.is_finite())];
    let point = [number.clone(), number.clone(), number].prop_map(DVec3::from_array);
    let kind = prop::sample::select(vec![OrganKind::MainStem, OrganKind::Stem, OrganKind::Leaf]);
    let rows = prop::collection::vec((point, any::<[u8; 3]>(), any::<i32>(), kind), 0..40);
    (rows, any::<[bool; 3]>()).prop_map(|(rows, [coloured, labelled, apart])| PointCloud {
        points: rows.iter().map(|r| r.0).collect(),
        colours: coloured.then(|| rows.iter().map(|r| r.1).collect()),
        labels: labelled.then(|| rows.iter().map(|r| r.2).collect()),
        organs: apart.then(|| rows.iter().map(|r| PointOrgan { organ: r.2, kind: r.3 }).collect()),
    })
}

/// The same cloud in another encoding, with an element before the vertices, strange properties among them and an
/// element behind.
fn other_encoding(cloud: &PointCloud, format: &str, ends_in_newline: bool) -> Vec<u8> {
    let mut header = format!(
        "ply\nformat {format} 1.0\ncomment made up\nelement camera 2\nproperty list ushort short view\n\
         property double focal\nelement vertex {}\nproperty double z\nproperty list uchar int strange\n",
        cloud.points.len()
    );
    header += "property double x\nproperty double y\n";
    if cloud.colours.is_some() {
        header += "property uchar blue\nproperty uchar green\nproperty uchar red\n";
    }
    if cloud.labels.is_some() {
        header += "property int instance\n";
    }
    if cloud.organs.is_some() {
        header += "property uchar kind\nproperty int organ\n";
    }
    header += "end_header\n";
    let mut bytes = header.into_bytes();
    let mut rows: Vec<Vec<Word>> = vec![vec![Word::U16(1), Word::I16(-7), Word::F64(1.5)]; 2];
    for (i, p) in cloud.points.iter().enumerate() {
        let mut row = vec![Word::F64(p.z), Word::U8(1), Word::I32(9), Word::F64(p.x), Word::F64(p.y)];
        row.extend(cloud.colours.iter().flat_map(|c| c[i].iter().rev().map(|b| Word::U8(*b))));
        row.extend(cloud.labels.iter().map(|l| Word::I32(l[i])));
        row.extend(cloud.organs.iter().flat_map(|o| [Word::U8(o[i].kind as u8), Word::I32(o[i].organ)]));
        rows.push(row);
    }
    if format == "ascii" {
        let lines: Vec<String> =
            rows.iter().map(|row| row.iter().map(Word::text).collect::<Vec<_>>().join(" ")).collect();
        bytes.extend(lines.join("\n").bytes());
        bytes.extend(ends_in_newline.then_some(b'\n'));
    } else {
        rows.iter().flatten().for_each(|word| bytes.extend(word.bytes(format == "binary_big_endian")));
    }
    bytes
}

#[derive(Clone)]
enum Word {
    U8(u8),
    U16(u16),
    I16(i16),
    I32(i32),
    F64(f64),
}

impl Word {
    fn text(&self) -> String {
        match self {
            Self::U8(x) => x.to_string(),
            Self::U16(x) => x.to_string(),
            Self::I16(x) => x.to_string(),
            Self::I32(x) => x.to_string(),
            Self::F64(x) => format!("{x:e}"),
        }
    }

    fn bytes(&self, big: bool) -> Vec<u8> {
        let mut bytes = match self {
            Self::U8(x) => x.to_le_bytes().to_vec(),
            Self::U16(x) => x.to_le_bytes().to_vec(),
            Self::I16(x) => x.to_le_bytes().to_vec(),
            Self::I32(x) => x.to_le_bytes().to_vec(),
            Self::F64(x) => x.to_le_bytes().to_vec(),
        };
        if big {
            bytes.reverse();
        }
        bytes
    }
}

proptest! {
    #![proptest_config(crate::common::cases(256))]

    #[test]
    fn a_cloud_written_reads_back_equal(cloud in clouds()) {
        prop_assert_eq!(PointCloud::from_ply(&cloud_to_ply(&cloud)), Ok(cloud));
    }

    #[test]
    fn every_encoding_reads_alike(
        cloud in clouds(),
        format in prop::sample::select(vec!["ascii", "binary_little_endian", "binary_big_endian"]),
        newline in any::<bool>(),
    ) {
        let read = PointCloud::from_ply(&other_encoding(&cloud, format, newline));
        prop_assert_eq!(read, Ok(cloud));
    }

    #[test]
    fn no_bytes_make_it_panic_and_no_truncation_passes_for_the_whole(
        cloud in clouds(),
        format in prop::sample::select(vec!["ascii", "binary_little_endian", "binary_big_endian"]),
        at in any::<prop::sample::Index>(),
        byte in any::<u8>(),
    ) {
        let mut bytes = other_encoding(&cloud, format, true);
        let cut = &bytes[..at.index(bytes.len())];
        // Without its last digits an ascii number is another number; all other cuts are noticed.
        if format != "ascii" && !cloud.points.is_empty() {
            prop_assert!(PointCloud::from_ply(cut).is_err());
        }
        let i = at.index(bytes.len());
        bytes[i] = byte;
        if let Ok(read) = PointCloud::from_ply(&bytes) {
            prop_assert!(read.points.iter().all(|p| p.is_finite()));
            prop_assert!(read.colours.is_none_or(|c| c.len() == read.points.len()));
            prop_assert!(read.labels.is_none_or(|l| l.len() == read.points.len()));
            prop_assert!(read.organs.is_none_or(|o| o.len() == read.points.len()));
        }
    }
}

fn ascii(vertex_header: &str, rows: &str) -> Result<PointCloud, PlyError> {
    PointCloud::from_ply(format!("ply\nformat ascii 1.0\n{vertex_header}\nend_header\n{rows}").as_bytes())
}

#[test]
fn bad_files_are_refused_by_name() {
    let xyz = "property float x\nproperty float y\nproperty float z";
    let vertices = |n: usize| format!("element vertex {n}\n{xyz}");
    assert!(matches!(PointCloud::from_ply(b"obj"), Err(PlyError::Header { .. })));
    assert!(matches!(PointCloud::from_ply(b""), Err(PlyError::Header { .. })));
    assert!(matches!(ascii("element face 0", ""), Err(PlyError::Header { .. })));
    assert!(matches!(ascii("element vertex 1\nproperty float y", "1"), Err(PlyError::Property { expected: "x" })));
    assert_eq!(
        ascii(&vertices(MAX_POINTS + 1), "0 0 0"),
        Err(PlyError::TooMany { expected: MAX_POINTS, found: MAX_POINTS + 1 })
    );
    assert!(matches!(ascii(&vertices(1000), "0 0 0"), Err(PlyError::Truncated { expected: 6000, found: 5 })));
    assert!(matches!(ascii(&vertices(2), "0 0 0 0 0"), Err(PlyError::Truncated { .. })));
    assert!(matches!(ascii(&vertices(1), "0 zero 0"), Err(PlyError::Data { .. })));
    assert!(matches!(ascii(&vertices(2), "0 0 0\n0 nan 0"), Err(PlyError::Vertex { vertex: 1, .. })));
    let labelled = format!("{}\nproperty double label", vertices(1));
    assert!(matches!(ascii(&labelled, "0 0 0 1e300"), Err(PlyError::Vertex { vertex: 0, .. })));
    // Rows without bytes would be walked for ever.
    let endless = format!("element nothing {}\n{}", u64::MAX, vertices(1));
    assert!(matches!(ascii(&endless, "0 0 0"), Err(PlyError::Header { .. })));
    let long = format!("element long {}\nproperty list uint double x\n{}", u64::MAX, vertices(1));
    assert!(matches!(ascii(&long, "0 0 0"), Err(PlyError::Truncated { .. })));
    let list = b"ply\nformat binary_little_endian 1.0\nelement long 1\nproperty list uint double x\n\
        element vertex 0\nproperty float x\nproperty float y\nproperty float z\nend_header\n\xff\xff\xff\xff";
    assert!(matches!(PointCloud::from_ply(list), Err(PlyError::Truncated { .. })));
}

#[test]
fn organs_are_two_properties_after_all_others() {
    let organs = [PointOrgan { organ: 0, kind: OrganKind::MainStem }, PointOrgan { organ: 258, kind: OrganKind::Leaf }];
    let cloud = PointCloud { points: vec![DVec3::X, DVec3::Y], organs: Some(organs.to_vec()), ..PointCloud::default() };
    let bytes = cloud_to_ply(&cloud);
    assert!(String::from_utf8_lossy(&bytes).contains("property int organ\nproperty uchar kind\nend_header\n"));
    assert_eq!(bytes[bytes.len() - 5..], [2, 1, 0, 0, 2]);
    let apart = |properties: &str, row: &str| {
        let xyz = "element vertex 1\nproperty float x\nproperty float y\nproperty float z";
        ascii(&format!("{xyz}{properties}"), &format!("0 0 0 {row}")).map(|cloud| cloud.organs)
    };
    let both = "\nproperty int organ\nproperty int kind";
    assert_eq!(apart(both, "7 2"), Ok(Some(vec![PointOrgan { organ: 7, kind: OrganKind::Leaf }])));
    assert!(matches!(apart(both, "7 3"), Err(PlyError::Vertex { vertex: 0, .. })), "there is no fourth kind");
    assert_eq!(apart("\nproperty int organ", "7"), Ok(None), "an organ without its kind says nothing");
}

#[test]
fn real_scans_are_read() {
    let test = "real_scans_are_read";
    let read = |file: &str| {
        let file = shared(test, file)?;
        let bytes = std::fs::read(&file).unwrap();
        Some(PointCloud::from_ply(&bytes).unwrap_or_else(|error| panic!("{}: {error}", file.display())))
    };
    let Some(soybean) = read("soybean-clouds/27_o.ply") else { return };
    assert_eq!((soybean.points.len(), soybean.colours.map(|c| c.len()), soybean.labels), (5000, Some(5000), None));
    let maize = read("organ-clouds/maize/maize_control_plant1_D08.ply").unwrap();
    let labels = maize.labels.unwrap();
    assert_eq!((labels.len(), maize.colours), (10_000, None));
    assert!(labels.contains(&0) && labels.iter().all(|l| (0..50).contains(l)), "{:?}", labels.iter().max());
    let tomato = read("bonn-clouds/tomato/03-10.ply").unwrap();
    assert_eq!(tomato.points.len(), 261_379);
    assert!(diagonal(&tomato.points).unwrap() > 0.0);
}
