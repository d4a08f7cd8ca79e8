//! Torch archives (.pth, and the release's graph.pkl): a zip of one pickle and the numbers of its tensors.

use std::collections::BTreeMap;
use std::io::{Cursor, Read};

use zip::ZipArchive;

use super::ReleaseError;
use super::pickle::{Pickle, Value};

/// Largest pickle read, bytes: 50 times that of the release's largest plant.
const MAX_PICKLE: usize = 1 << 24;
/// Most numbers in all tensors of an archive (32 MB of f64): 10 times the release's largest plant.
const MAX_NUMBERS: usize = 1 << 22;
/// Bytes of torch's `FloatStorage` per number.
const F32: usize = 4;

/// The tensors of an archive.
#[derive(Debug)]
pub(super) struct Archive {
    file: String,
    /// Numbers of f32 tensors by name, row-major whatever their strides in the file.
    tensors: BTreeMap<String, Vec<f64>>,
    /// In the file's order.
    names: Vec<String>,
}

impl Archive {
    /// Reads an archive; `file` names it in errors.
    pub(super) fn read(file: &str, bytes: &[u8]) -> Result<Self, ReleaseError> {
        let broken =
            |error: &dyn std::error::Error| ReleaseError::Archive { file: file.into(), found: error.to_string() };
        let mut zip = ZipArchive::new(Cursor::new(bytes)).map_err(|error| broken(&error))?;
        let root = zip.file_names().flatten().find_map(|name| name.strip_suffix("data.pkl").map(str::to_owned));
        let Some(root) = root else {
            return Err(ReleaseError::Archive { file: file.into(), found: "no data.pkl".into() });
        };
        let mut entry = |name: &str, limit: usize| -> Result<Vec<u8>, ReleaseError> {
            let mut content = Vec::new();
            let reader = zip.by_name(&format!("{root}{name}")).map_err(|error| broken(&error))?;
            reader.take(limit as u64).read_to_end(&mut content).map_err(|error| broken(&error))?;
            Ok(content)
        };
        let pickle = Pickle::read(&entry("data.pkl", MAX_PICKLE)?)
            .map_err(|source| ReleaseError::Pickle { file: file.into(), source })?;
        let (mut tensors, mut names, mut total) = (BTreeMap::new(), Vec::new(), 0_usize);
        for &(key, value) in pickle.entries() {
            let Value::Text(name) = pickle.get(key) else {
                return Err(ReleaseError::tensor(file, "", "a name", "another key"));
            };
            let wrong = |expected: &'static str, found: String| ReleaseError::tensor(file, name, expected, found);
            let layout =
                Layout::of(&pickle, value).ok_or_else(|| wrong("a dense tensor of f32", "another value".into()))?;
            // Numbers reached, not numbers held: one far index costs as much as a tensor of that size.
            let (count, reach) = layout.size().unwrap_or((usize::MAX, usize::MAX));
            total = reach.max(count).saturating_add(total);
            if total > MAX_NUMBERS {
                return Err(wrong("tensors of at most 4194304 numbers in all", "more".into()));
            }
            let needed = reach * F32;
            let storage = entry(&format!("data/{}", layout.storage), needed)?;
            let numbers = layout.numbers(&storage, count).ok_or_else(|| {
                wrong("finite numbers in its storage", format!("{} bytes of {needed}, or others", storage.len()))
            })?;
            names.push(name.clone());
            tensors.insert(name.clone(), numbers);
        }
        Ok(Self { file: file.into(), tensors, names })
    }

    /// Names in the file's order.
    pub(super) fn names(&self) -> &[String] {
        &self.names
    }

    /// The numbers of the tensor `name`.
    pub(super) fn any(&self, name: &str) -> Result<&[f64], ReleaseError> {
        match self.tensors.get(name) {
            Some(numbers) => Ok(numbers),
            None => Err(ReleaseError::tensor(&self.file, name, "a tensor", "none")),
        }
    }

    /// The numbers of the tensor `name`, which must have `expected` of them.
    pub(super) fn numbers(&self, name: &str, expected: usize) -> Result<&[f64], ReleaseError> {
        let numbers = self.any(name)?;
        if numbers.len() == expected {
            return Ok(numbers);
        }
        Err(ReleaseError::Size { file: self.file.clone(), tensor: name.into(), expected, found: numbers.len() })
    }
}

/// Where a tensor's numbers lie: what `torch._utils._rebuild_tensor_v2` would be told.
struct Layout {
    storage: String,
    offset: usize,
    shape: Vec<usize>,
    strides: Vec<usize>,
}

impl Layout {
    fn of(pickle: &Pickle, tensor: usize) -> Option<Self> {
        let ("torch._utils _rebuild_tensor_v2", [storage, offset, shape, strides, ..]) = pickle.call(tensor)? else {
            return None;
        };
        let Value::Persistent(storage) = pickle.get(*storage) else { return None };
        let Value::Tuple(parts) = pickle.get(*storage) else { return None };
        let [_, kind, key, ..] = parts.as_slice() else { return None };
        let (Value::Global(kind), Value::Text(key)) = (pickle.get(*kind), pickle.get(*key)) else { return None };
        let size = |id: usize| match pickle.get(id) {
            Value::Int(number) => usize::try_from(*number).ok(),
            _ => None,
        };
        let sizes = |id: usize| match pickle.get(id) {
            Value::Tuple(parts) => parts.iter().map(|part| size(*part)).collect::<Option<Vec<_>>>(),
            _ => None,
        };
        let layout =
            Self { storage: key.clone(), offset: size(*offset)?, shape: sizes(*shape)?, strides: sizes(*strides)? };
        // More than 8 axes would only make the walk over the numbers long.
        let fits = layout.shape.len() == layout.strides.len() && layout.shape.len() <= 8;
        (kind == "torch FloatStorage" && fits).then_some(layout)
    }

    /// How many numbers there are, and one more than the largest index into the storage.
    fn size(&self) -> Option<(usize, usize)> {
        let count = self.shape.iter().try_fold(1_usize, |n, side| n.checked_mul(*side))?;
        if count == 0 {
            return Some((0, 0));
        }
        let mut steps = self.shape.iter().zip(&self.strides).map(|(side, stride)| (side - 1).checked_mul(*stride));
        let reach = steps.try_fold(self.offset.checked_add(1)?, |sum, step| sum.checked_add(step?))?;
        Some((count, reach))
    }

    fn numbers(&self, storage: &[u8], count: usize) -> Option<Vec<f64>> {
        let number = |mut index: usize| {
            let mut at = self.offset;
            for (side, stride) in self.shape.iter().zip(&self.strides).rev() {
                at += index % side * stride;
                index /= side;
            }
            let bytes = storage.get(at * F32..)?.first_chunk::<F32>()?;
            Some(f64::from(f32::from_le_bytes(*bytes))).filter(|x| x.is_finite())
        };
        (0..count).map(number).collect()
    }
}
