//! Tiny ONNX files written byte by byte (field numbers of onnx.proto), whose answers are known without a network.

use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};

/// One 1x1 convolution without bias from `image` [n,3,h,w] for each map: rows of three weights, a row a channel; `camera`
/// is such rows of the picture's mean colour.
#[derive(Clone)]
pub(crate) struct Graph {
    pub(crate) sem: Vec<[f32; 3]>,
    pub(crate) dist: Vec<[f32; 3]>,
    pub(crate) depth: Vec<[f32; 3]>,
    pub(crate) camera: Vec<[f32; 3]>,
    /// ONNX element type of the input that the graph claims: 1 is f32, 10 is f16.
    pub(crate) input_type: u64,
    /// Stride of the `dist` convolution: 2 gives a map of half the size.
    pub(crate) dist_stride: u64,
    /// Says that the weights of `sem` lie in a file.
    pub(crate) external: bool,
}

impl Default for Graph {
    /// Background logit 0, leaf red, stem green, main stem blue; dist = green, depth = red - blue; up in the camera's frame
    /// is the mean colour, the rest of the camera is 0.
    fn default() -> Self {
        Self {
            sem: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            dist: vec![[0.0, 1.0, 0.0]],
            depth: vec![[1.0, 0.0, -1.0]],
            camera: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0; 3], [0.0; 3]],
            input_type: 1,
            dist_stride: 1,
            external: false,
        }
    }
}

fn varint(mut value: u64) -> Vec<u8> {
    let mut bytes = Vec::new();
    while value >= 0x80 {
        bytes.push(value as u8 | 0x80);
        value >>= 7;
    }
    bytes.push(value as u8);
    bytes
}

fn number(field: u64, value: u64) -> Vec<u8> {
    [varint(field << 3), varint(value)].concat()
}

fn bytes(field: u64, value: &[u8]) -> Vec<u8> {
    [varint(field << 3 | 2), varint(value.len() as u64), value.to_vec()].concat()
}

fn text(field: u64, value: &str) -> Vec<u8> {
    bytes(field, value.as_bytes())
}

/// Of a map, or of the `camera`, which has no sides.
fn port(field: u64, name: &str, channels: u64, element: u64) -> Vec<u8> {
    let dims = [text(2, "n"), number(1, channels), text(2, "h"), text(2, "w")].map(|dim| bytes(1, &dim));
    let dims = dims[..if name == "camera" { 2 } else { 4 }].concat();
    let tensor = [number(1, element), bytes(2, &dims)].concat();
    bytes(field, &[text(1, name), bytes(2, &bytes(1, &tensor))].concat())
}

impl Graph {
    /// The file's bytes.
    pub(crate) fn onnx(&self) -> Vec<u8> {
        let outputs = [
            ("sem", &self.sem, 1),
            ("dist", &self.dist, self.dist_stride),
            ("depth", &self.depth, 1),
            ("camera", &self.camera, 1),
        ];
        let mut graph = text(2, "test");
        graph.extend(bytes(1, &[text(1, "image"), text(2, "mean"), text(4, "GlobalAveragePool")].concat()));
        for (name, _, stride) in outputs {
            let strides = [text(1, "strides"), number(8, stride), number(8, stride), number(20, 7)].concat();
            let weights = format!("{name}_weights");
            let (input, output) = if name == "camera" { ("mean", "column") } else { ("image", name) };
            let node = [text(1, input), text(1, &weights), text(2, output), text(4, "Conv"), bytes(5, &strides)];
            graph.extend(bytes(1, &node.concat()));
        }
        graph.extend(bytes(1, &[text(1, "column"), text(2, "camera"), text(4, "Flatten")].concat()));
        for (name, rows, _) in outputs {
            let data: Vec<u8> = rows.iter().flatten().flat_map(|weight| weight.to_le_bytes()).collect();
            let dims = [rows.len() as u64, 3, 1, 1].map(|dim| number(1, dim)).concat();
            let mut tensor = [dims, number(2, 1), text(8, &format!("{name}_weights"))].concat();
            if self.external && name == "sem" {
                tensor.extend(bytes(13, &[text(1, "location"), text(2, "weights.bin")].concat()));
                tensor.extend(number(14, 1));
            } else {
                tensor.extend(bytes(9, &data));
            }
            graph.extend(bytes(5, &tensor));
        }
        graph.extend(port(11, "image", 3, self.input_type));
        for (name, rows, _) in outputs {
            graph.extend(port(12, name, rows.len() as u64, self.input_type));
        }
        [number(1, 8), bytes(8, &number(2, 17)), bytes(7, &graph)].concat()
    }
}

/// A manifest for these bytes with organ2d's ports.
pub(crate) fn manifest(onnx: &[u8]) -> String {
    let sha256: String = Sha256::digest(onnx).iter().map(|byte| format!("{byte:02x}")).collect();
    let port =
        |name: &str, channels| format!("{{ name = {name:?}, shape = [-1, {channels}, -1, -1], dtype = \"f32\" }}");
    let camera = "{ name = \"camera\", shape = [-1, 6], dtype = \"f32\" }".to_owned();
    let outputs = [port("sem", 4), port("dist", 1), port("depth", 1), camera].join(", ");
    format!(
        "name = \"test\"\nversion = \"1\"\nlayout = \"organ2d\"\nsha256 = \"{sha256}\"\nnormalisation = \"none\"\n\
         inputs = [{}]\noutputs = [{outputs}]\n\
         [provenance]\ncommand = \"by hand\"\nseed = 0\nsteps = 0\nprogram = \"test\"\ndata = []\nfigures = {{}}\n",
        port("image", 3)
    )
}

/// Writes `test.onnx` and its manifest; gives the manifest's path.
pub(crate) fn write(folder: &Path, onnx: &[u8], manifest: &str) -> PathBuf {
    std::fs::write(folder.join("test.onnx"), onnx).unwrap();
    let path = folder.join("test.toml");
    std::fs::write(&path, manifest).unwrap();
    path
}
