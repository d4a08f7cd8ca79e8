use std::io::Read;
use std::num::NonZeroUsize;
use std::path::Path;

use ndarray::{Array, Array4, ArrayView4, IxDyn};
use ort::session::Session;
use ort::session::builder::GraphOptimizationLevel;
use ort::value::{Outlet, TensorRef, ValueType};
use sha2::{Digest, Sha256};

use crate::external::{self, Finding};
use crate::{Manifest, ModelError, Port, Runtime};

/// The largest model file accepted, 64 MiB: ours are 2 MB, and a small box must not be filled by a wrong file.
pub const MAX_BYTES: u64 = 64 << 20;

/// A verified model, ready to run. May be moved between threads; runs on one at a time.
#[derive(Debug)]
pub struct Model {
    manifest: Manifest,
    session: Session,
}

impl Model {
    /// Opens the model that the manifest at `path` describes, to run on `threads` threads.
    ///
    /// The file's size and sha256 are checked before anything parses it, and the same bytes are then used, so that the
    /// file may change afterwards without harm.
    ///
    /// # Errors
    /// [`ModelError`], with what was expected and what was found.
    pub fn open(runtime: &Runtime, path: &Path, threads: NonZeroUsize) -> Result<Self, ModelError> {
        let manifest = Manifest::read(path)?;
        let path = Manifest::model_path(path);
        let bytes = read_bounded(&path)?;
        let found = hex(&Sha256::digest(&bytes));
        if found != manifest.sha256 {
            return Err(ModelError::Sha256 { path, expected: manifest.sha256, found });
        }
        external::check(&bytes).map_err(|finding| match finding {
            Finding::External(tensor) => ModelError::ExternalData { path: path.clone(), tensor },
            Finding::Malformed(offset) => ModelError::Malformed { path: path.clone(), offset },
        })?;
        let session = session(runtime, &bytes, threads)
            .map_err(|error| ModelError::Session { name: manifest.name.clone(), message: error.to_string() })?;
        same_ports(&manifest.name, &manifest.inputs, session.inputs())?;
        same_ports(&manifest.name, &manifest.outputs, session.outputs())?;
        tracing::info!(model = manifest.name, version = manifest.version, provider = Self::PROVIDER, "model opened");
        Ok(Self { manifest, session })
    }

    /// The execution provider that runs every node: sessions register no other, and this one is always there.
    pub const PROVIDER: &str = "CPUExecutionProvider";

    /// What the model's manifest says.
    #[must_use]
    pub fn manifest(&self) -> &Manifest {
        &self.manifest
    }

    /// Runs the model's one input `[n, c, h, w]`; the outputs `[n, ?, ?, ?]` come in the manifest's order, all finite.
    ///
    /// # Errors
    /// [`ModelError::Session`], [`ModelError::Shape`] for an output that has not four dimensions,
    /// [`ModelError::NotFinite`].
    pub fn run(&mut self, input: ArrayView4<'_, f32>) -> Result<Vec<Array4<f32>>, ModelError> {
        let name = &self.manifest.name;
        let failed = |error: ort::Error| ModelError::Session { name: name.clone(), message: error.to_string() };
        let input = input.as_standard_layout();
        let tensor = TensorRef::from_array_view(input.view()).map_err(failed)?;
        let outputs = self.session.run(ort::inputs![tensor]).map_err(failed)?;
        let array = |(port, value): (&Port, ort::value::ValueRef<'_>)| {
            let (shape, values) = value.try_extract_tensor::<f32>().map_err(failed)?;
            let shape: Vec<usize> = shape.iter().map(|&side| side as usize).collect();
            let output = port.name.clone();
            if let Some(index) = values.iter().position(|value| !value.is_finite()) {
                return Err(ModelError::NotFinite { name: name.clone(), output, found: values[index], index });
            }
            let array = Array::from_shape_vec(IxDyn(&shape), values.to_vec()).and_then(Array::into_dimensionality);
            array.map_err(|_wrong_rank| ModelError::Shape {
                name: name.clone(),
                output,
                expected: input.shape().to_vec(),
                found: shape,
            })
        };
        self.manifest.outputs.iter().zip(outputs.values()).map(array).collect()
    }
}

fn session(runtime: &Runtime, bytes: &[u8], threads: NonZeroUsize) -> ort::Result<Session> {
    // Explicit thread counts, else the library calls sched_setaffinity, which a service's seccomp filter may refuse.
    Session::builder(&runtime.environment)?
        .with_optimization_level(GraphOptimizationLevel::All)?
        .with_intra_threads(threads.get())?
        .with_inter_threads(1)?
        .commit_from_memory(bytes)
}

fn read_bounded(path: &Path) -> Result<Vec<u8>, ModelError> {
    let io = |source| ModelError::Io { path: path.into(), source };
    let file = std::fs::File::open(path).map_err(io)?;
    let mut bytes = Vec::new();
    file.take(MAX_BYTES + 1).read_to_end(&mut bytes).map_err(io)?;
    let found = bytes.len() as u64;
    if found > MAX_BYTES {
        return Err(ModelError::TooLarge { path: path.into(), expected: MAX_BYTES, found });
    }
    Ok(bytes)
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Checks that the graph has exactly the ports that were promised.
fn same_ports(name: &str, expected: &[Port], found: &[Outlet]) -> Result<(), ModelError> {
    let found: Vec<Port> = found.iter().map(port).collect();
    if found == expected {
        return Ok(());
    }
    Err(ModelError::Ports { name: name.into(), expected: ports(expected), found: ports(&found) })
}

fn port(outlet: &Outlet) -> Port {
    let (dtype, shape) = match outlet.dtype() {
        ValueType::Tensor { ty, shape, .. } => (ty.to_string(), shape.to_vec()),
        other => (other.to_string(), Vec::new()),
    };
    Port { name: outlet.name().into(), shape, dtype }
}

/// Ports as one readable line.
pub(crate) fn ports(ports: &[Port]) -> String {
    ports.iter().map(Port::to_string).collect::<Vec<_>>().join(", ")
}
