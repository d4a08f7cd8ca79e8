use std::io::Read;
use std::num::NonZeroUsize;
use std::path::Path;

use ndarray::{CowArray, IxDyn};
use ort::session::builder::GraphOptimizationLevel;
use ort::session::{Session, SessionInputValue};
use ort::value::{Outlet, TensorRef, ValueType};
use sha2::{Digest, Sha256};

use crate::external::{self, Finding};
use crate::tensor::array;
use crate::{Layout, Manifest, ModelError, Outputs, Port, Runtime, Tensor};

/// The largest model file accepted, 512 MiB. Ours have 2 MB; of other people's the largest that a small box can run at
/// all is SAM's ViT-B encoder, 360 MB, then Mask R-CNN's 180 and Depth Anything S's 100. The bytes are held beside the
/// session while it is made, so a wrong file costs a box at most twice this bound, and only until it is refused.
pub const MAX_BYTES: u64 = 512 << 20;

/// A verified model, ready to run. May be moved between threads; runs on one at a time.
#[derive(Debug)]
pub struct Model {
    manifest: Manifest,
    /// What the layout calls a port, and what the graph does; ports that are not here go by their own names.
    roles: Vec<(&'static str, String)>,
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
        let found = sha256(&bytes);
        if found != manifest.sha256 {
            return Err(ModelError::Sha256 { path, expected: manifest.sha256, found });
        }
        let session = parse(runtime, &path, &bytes, threads)?;
        same_ports(&manifest.name, &manifest.inputs, session.inputs())?;
        same_ports(&manifest.name, &manifest.outputs, session.outputs())?;
        let roles = manifest.layout.roles(&manifest.inputs, &manifest.outputs)?;
        tracing::info!(model = manifest.name, version = manifest.version, provider = Self::PROVIDER, "model opened");
        Ok(Self { manifest, roles, session })
    }

    /// The same, refusing another layout than these.
    pub(crate) fn open_as(
        runtime: &Runtime,
        path: &Path,
        threads: NonZeroUsize,
        layouts: &[Layout],
    ) -> Result<Self, ModelError> {
        let model = Self::open(runtime, path, threads)?;
        if layouts.contains(&model.manifest.layout) {
            return Ok(model);
        }
        let Manifest { name, layout, .. } = model.manifest;
        Err(ModelError::Ports { name, expected: format!("one of {layouts:?}"), found: format!("{layout:?}") })
    }

    /// Refuses other ports than these, which may differ from the manifest's even where graph and manifest agree.
    pub(crate) fn needs(&self, inputs: &[Port], outputs: &[Port]) -> Result<(), ModelError> {
        let Manifest { name, inputs: found_inputs, outputs: found_outputs, .. } = &self.manifest;
        for (expected, found) in [(inputs, found_inputs), (outputs, found_outputs)] {
            if expected != found {
                let (expected, found) = (ports(expected), ports(found));
                return Err(ModelError::Ports { name: name.clone(), expected, found });
            }
        }
        Ok(())
    }

    /// The execution provider that runs every node: sessions register no other, and this one is always there.
    pub const PROVIDER: &str = "CPUExecutionProvider";

    /// What the model's manifest says.
    #[must_use]
    pub fn manifest(&self) -> &Manifest {
        &self.manifest
    }

    /// Runs the model on its inputs, given by name in any order; the outputs come in the manifest's order, all finite.
    /// Names are the layout's where the layout is other people's, else the graph's.
    ///
    /// # Errors
    /// [`ModelError::Session`] for inputs that are missing or do not fit, [`ModelError::ElementType`] for an output that
    /// is neither f32 nor i64, [`ModelError::NotFinite`].
    pub fn run(&mut self, inputs: &[(&str, Tensor)]) -> Result<Outputs, ModelError> {
        let (model, roles) = (&self.manifest.name, &self.roles);
        let port_of =
            |role: &str| roles.iter().find(|(ours, _)| *ours == role).map_or(role, |(_, port)| port).to_owned();
        let role_of =
            |port: &str| roles.iter().find(|(_, theirs)| theirs == port).map_or(port, |(role, _)| role).to_owned();
        let failed = |error: ort::Error| ModelError::Session { name: model.clone(), message: error.to_string() };
        // ONNX Runtime reads arrays in row-major order only; one that lies otherwise is copied by `as_standard_layout`.
        let inputs: Vec<_> = inputs.iter().map(|(role, tensor)| (port_of(role), Standard::of(tensor))).collect();
        let values = inputs.iter().map(|(port, tensor)| Ok((port.as_str(), tensor.value()?)));
        let values = values.collect::<Result<Vec<_>, _>>().map_err(failed)?;
        let outputs = self.session.run(values).map_err(failed)?;
        let tensor = |(port, value): (&Port, ort::value::ValueRef<'_>)| {
            let output = || (model.clone(), port.name.clone());
            let tensor = if let Ok((shape, values)) = value.try_extract_tensor::<f32>() {
                if let Some(index) = values.iter().position(|value| !value.is_finite()) {
                    let (name, output) = output();
                    return Err(ModelError::NotFinite { name, output, found: values[index], index });
                }
                array(shape, values).map(Tensor::F32)
            } else if let Ok((shape, values)) = value.try_extract_tensor::<i64>() {
                array(shape, values).map(Tensor::I64)
            } else {
                None
            };
            let tensor = tensor.ok_or_else(|| {
                let (name, output) = output();
                ModelError::ElementType { name, output, found: value.dtype().to_string() }
            })?;
            Ok((role_of(&port.name), tensor))
        };
        let tensors = self.manifest.outputs.iter().zip(outputs.values()).map(tensor).collect::<Result<_, _>>()?;
        Ok(Outputs { model: model.clone(), tensors })
    }
}

/// A tensor whose elements lie in row-major order.
enum Standard<'a> {
    F32(CowArray<'a, f32, IxDyn>),
    I64(CowArray<'a, i64, IxDyn>),
}

impl<'a> Standard<'a> {
    fn of(tensor: &'a Tensor) -> Self {
        match tensor {
            Tensor::F32(array) => Self::F32(array.as_standard_layout()),
            Tensor::I64(array) => Self::I64(array.as_standard_layout()),
        }
    }

    fn value(&self) -> ort::Result<SessionInputValue<'_>> {
        Ok(match self {
            Self::F32(array) => TensorRef::from_array_view(array.view())?.into(),
            Self::I64(array) => TensorRef::from_array_view(array.view())?.into(),
        })
    }
}

/// A session of bytes that were checked to be one whole ONNX message.
pub(crate) fn parse(
    runtime: &Runtime,
    path: &Path,
    bytes: &[u8],
    threads: NonZeroUsize,
) -> Result<Session, ModelError> {
    external::check(bytes).map_err(|finding| match finding {
        Finding::External(tensor) => ModelError::ExternalData { path: path.into(), tensor },
        Finding::Malformed(offset) => ModelError::Malformed { path: path.into(), offset },
    })?;
    // Explicit thread counts, else the library calls sched_setaffinity, which a service's seccomp filter may refuse.
    let session = || {
        Session::builder(&runtime.environment)?
            .with_optimization_level(GraphOptimizationLevel::All)?
            .with_intra_threads(threads.get())?
            .with_inter_threads(1)?
            .commit_from_memory(bytes)
    };
    session().map_err(|error: ort::Error| ModelError::Session {
        name: path.file_stem().unwrap_or_default().to_string_lossy().into_owned(),
        message: error.to_string(),
    })
}

/// A file's bytes, at most [`MAX_BYTES`].
pub(crate) fn read_bounded(path: &Path) -> Result<Vec<u8>, ModelError> {
    let io = |source| ModelError::Io { path: path.into(), source };
    let file = std::fs::File::open(path).map_err(io)?;
    // What announces its size is refused without reading; what does not, a pipe, after the bound.
    let announced = file.metadata().map_err(io)?.len();
    let mut bytes = Vec::new();
    if announced <= MAX_BYTES {
        file.take(MAX_BYTES + 1).read_to_end(&mut bytes).map_err(io)?;
    }
    let found = announced.max(bytes.len() as u64);
    if found > MAX_BYTES {
        return Err(ModelError::TooLarge { path: path.into(), expected: MAX_BYTES, found });
    }
    Ok(bytes)
}

/// Lower-case hexadecimal.
pub(crate) fn sha256(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Checks that the graph has exactly the ports that were promised.
fn same_ports(name: &str, expected: &[Port], found: &[Outlet]) -> Result<(), ModelError> {
    let found: Vec<Port> = found.iter().map(port).collect();
    if found == expected {
        return Ok(());
    }
    Err(ModelError::Ports { name: name.into(), expected: ports(expected), found: ports(&found) })
}

pub(crate) fn port(outlet: &Outlet) -> Port {
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
