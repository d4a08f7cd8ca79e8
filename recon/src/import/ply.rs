//! Point clouds from PLY files: ascii, binary little and big endian.

use std::io::{Chain, ErrorKind, Read};

use glam::DVec3;
use serde::Deserialize;
use serde::de::{Deserializer, SeqAccess, Visitor};
use serde_ply::{DeserializeError, ElementDef, PlyFormat, PlyHeader, PlyReader, PropertyType, ScalarType};

use crate::cloud::{PointCloud, PointOrgan};
use crate::model::OrganKind;

/// Most points a cloud may have: a bound on memory (1 GB as read), 50 times the largest scan in our data.
pub const MAX_POINTS: usize = 20_000_000;

/// Why bytes are no point cloud.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum PlyError {
    /// The header is none of PLY's.
    #[error("PLY header: {found}")]
    Header {
        /// What is wrong with it.
        found: String,
    },
    /// A property that points need is missing.
    #[error("PLY element vertex: expected a number `{expected}`")]
    Property {
        /// The property.
        expected: &'static str,
    },
    /// More points than [`MAX_POINTS`].
    #[error("PLY: expected at most {expected} points, found {found}")]
    TooMany {
        /// The bound.
        expected: usize,
        /// How many the header announces.
        found: usize,
    },
    /// Fewer bytes than the header announces.
    #[error("PLY data: expected at least {expected} bytes after the header, found {found}")]
    Truncated {
        /// Least number of bytes that the header's counts need.
        expected: usize,
        /// Bytes after the header.
        found: usize,
    },
    /// Data that cannot be read as the header says.
    #[error("PLY data: {found}")]
    Data {
        /// What the reader found.
        found: String,
    },
    /// A vertex whose numbers are not finite, whose label or organ is no 32-bit integer, or whose kind is none.
    #[error("PLY vertex {vertex}: expected {expected}, found {found}")]
    Vertex {
        /// Index of the vertex.
        vertex: usize,
        /// What it must hold.
        expected: &'static str,
        /// What it holds.
        found: String,
    },
}

impl PointCloud {
    /// Reads the element `vertex` of a PLY file: `x y z` of any scalar type; `red green blue` when all three are
    /// uchar; the organ label from `label`, else from `instance`; the organ with its kind from `organ` and `kind` when
    /// both are there, of any scalar type. All else is skipped.
    ///
    /// Positions are taken as they are: PLY states neither unit nor axes. A point that is not finite refuses the file
    /// instead of vanishing from it.
    ///
    /// # Errors
    /// [`PlyError`]; sizes are checked against the bytes before anything is allocated for them.
    pub fn from_ply(bytes: &[u8]) -> Result<Self, PlyError> {
        let mut body = bytes;
        let reader =
            PlyReader::from_reader(&mut body).map_err(|error| PlyError::Header { found: error.0.to_string() })?;
        let header: PlyHeader = reader.header().clone();
        let before = check(&header, body.len())?;
        let vertex = &header.elem_defs[before];
        let has = |name: &str| vertex.properties.iter().any(|p| p.name == name);
        let coloured = ["red", "green", "blue"].iter().all(|name| {
            let uchar = |t: &PropertyType| matches!(t, PropertyType::Scalar(ScalarType::U8));
            vertex.properties.iter().any(|p| p.name == *name && uchar(&p.property_type))
        });
        // The reader takes a number to end at a space, also the last of an ascii file.
        let end: &[u8] = if header.format == PlyFormat::Ascii { b"\n" } else { b"" };
        let mut reader: PlyReader<Chain<&[u8], &[u8]>> = PlyReader::from_reader(bytes.chain(end))
            .map_err(|error| PlyError::Header { found: error.0.to_string() })?;
        let found = body.len();
        let data = |error: DeserializeError| match error.0.kind() {
            ErrorKind::UnexpectedEof => PlyError::Truncated { expected: found + 1, found },
            _ => PlyError::Data { found: error.0.to_string() },
        };
        for _ in 0..before {
            reader.next_element::<Skipped>().map_err(data)?;
        }
        let rows: Rows = reader.next_element().map_err(data)?;
        if let Some((vertex, expected, found)) = rows.bad {
            return Err(PlyError::Vertex { vertex, expected, found });
        }
        Ok(Self {
            points: rows.points,
            colours: coloured.then_some(rows.colours),
            labels: (has("label") || has("instance")).then_some(rows.labels),
            organs: (has("organ") && has("kind")).then_some(rows.organs),
        })
    }
}

/// Checks the header against the bytes that follow it; returns the index of the element `vertex`.
fn check(header: &PlyHeader, found: usize) -> Result<usize, PlyError> {
    let mut expected = 0_usize;
    for (i, element) in header.elem_defs.iter().enumerate() {
        let row = least_bytes(element, header.format);
        if row == 0 && element.count > 0 {
            return Err(PlyError::Header { found: format!("element `{}` without properties", element.name) });
        }
        if element.name == "vertex" && element.count > MAX_POINTS {
            return Err(PlyError::TooMany { expected: MAX_POINTS, found: element.count });
        }
        expected = expected.saturating_add(element.count.saturating_mul(row));
        // The last number of an ascii file needs no space behind it.
        if expected > found.saturating_add(usize::from(header.format == PlyFormat::Ascii)) {
            return Err(PlyError::Truncated { expected, found });
        }
        if element.name == "vertex" {
            let scalar = |name: &str| {
                element.properties.iter().any(|p| p.name == name && matches!(p.property_type, PropertyType::Scalar(_)))
            };
            return match ["x", "y", "z"].into_iter().find(|name| !scalar(name)) {
                Some(expected) => Err(PlyError::Property { expected }),
                None => Ok(i),
            };
        }
    }
    Err(PlyError::Header { found: "no element `vertex`".into() })
}

/// Least number of bytes that a row of an element takes.
fn least_bytes(element: &ElementDef, format: PlyFormat) -> usize {
    let scalar = |t: &ScalarType| match (format, t) {
        // A digit and a space.
        (PlyFormat::Ascii, _) => 2,
        (_, ScalarType::I8 | ScalarType::U8) => 1,
        (_, ScalarType::I16 | ScalarType::U16) => 2,
        (_, ScalarType::I32 | ScalarType::U32 | ScalarType::F32) => 4,
        (_, ScalarType::F64) => 8,
    };
    let size = |t: &PropertyType| match t {
        PropertyType::Scalar(t) | PropertyType::List { count_type: t, .. } => scalar(t),
    };
    element.properties.iter().map(|p| size(&p.property_type)).sum()
}

/// One vertex. The optional ones come last, because the reader is fast when a file has the first fields and no gap.
#[derive(Deserialize)]
struct Row {
    x: f64,
    y: f64,
    z: f64,
    #[serde(default)]
    red: Option<f64>,
    #[serde(default)]
    green: Option<f64>,
    #[serde(default)]
    blue: Option<f64>,
    #[serde(default)]
    label: Option<f64>,
    #[serde(default)]
    instance: Option<f64>,
    #[serde(default)]
    organ: Option<f64>,
    #[serde(default)]
    kind: Option<f64>,
}

/// All vertices, gathered row by row so that only what is kept takes memory.
#[derive(Default)]
struct Rows {
    points: Vec<DVec3>,
    colours: Vec<[u8; 3]>,
    labels: Vec<i32>,
    organs: Vec<PointOrgan>,
    /// The first bad vertex: index, what was expected, what was found.
    bad: Option<(usize, &'static str, String)>,
}

impl Rows {
    fn push(&mut self, row: &Row) -> Result<(), (&'static str, String)> {
        let point = DVec3::new(row.x, row.y, row.z);
        if !point.is_finite() {
            return Err(("finite x y z", point.to_string()));
        }
        self.points.push(point);
        if let (Some(r), Some(g), Some(b)) = (row.red, row.green, row.blue) {
            // The caller drops colours unless the header says that they are bytes.
            self.colours.push([r as u8, g as u8, b as u8]);
        }
        if let Some(label) = row.label.or(row.instance) {
            self.labels.push(integer(label).ok_or_else(|| ("a 32-bit label", label.to_string()))?);
        }
        if let (Some(organ), Some(kind)) = (row.organ, row.kind) {
            self.organs.push(PointOrgan {
                organ: integer(organ).ok_or_else(|| ("a 32-bit organ", organ.to_string()))?,
                kind: [OrganKind::MainStem, OrganKind::Stem, OrganKind::Leaf]
                    .into_iter()
                    .find(|k| f64::from(*k as u8) == kind)
                    .ok_or_else(|| ("a kind of 0, 1 or 2", kind.to_string()))?,
            });
        }
        Ok(())
    }
}

/// The nearest integer, `None` beyond 32 bits.
fn integer(x: f64) -> Option<i32> {
    let rounded = x.round();
    (f64::from(i32::MIN)..=f64::from(i32::MAX)).contains(&rounded).then_some(rounded as i32)
}

impl<'de> Deserialize<'de> for Rows {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Gather;
        impl<'de> Visitor<'de> for Gather {
            type Value = Rows;

            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str("vertices")
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<Rows, A::Error> {
                let mut rows = Rows::default();
                while let Some(row) = seq.next_element::<Row>()? {
                    let vertex = rows.points.len();
                    if let Err((expected, found)) = rows.push(&row) {
                        rows.bad = Some((vertex, expected, found));
                        break;
                    }
                }
                Ok(rows)
            }
        }
        deserializer.deserialize_seq(Gather)
    }
}

/// An element before the vertices, read and forgotten.
struct Skipped;

impl<'de> Deserialize<'de> for Skipped {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        #[derive(Deserialize)]
        struct Nothing {}
        struct Skip;
        impl<'de> Visitor<'de> for Skip {
            type Value = Skipped;

            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str("rows")
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<Skipped, A::Error> {
                while seq.next_element::<Nothing>()?.is_some() {}
                Ok(Skipped)
            }
        }
        deserializer.deserialize_seq(Skip)
    }
}
