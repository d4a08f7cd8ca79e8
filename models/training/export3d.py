"""organ3d as ONNX, its manifest and its pins (values that Rust must find again)."""

import json

import numpy as np
import torch

import clouds
import pyramid
from export import write_manifest
from network3d import CLASSES, INPUTS

PINNED_POINTS, PINS = 1500, 60
# Input -> length of its second dimension; without one it is a vector.
COLUMNS = {"local": pyramid.LOCAL, "up": pyramid.ABOVE}
COLUMNS |= {f"{kind}{level}": pyramid.NEIGHBOURS for kind in ("below", "beside") for level in (1, 2, 3)}
OUTPUTS = {"semantic": CLASSES, "boundary": 1}


def write(network, folder, version, provenance):
    """organ3d.onnx, organ3d.toml and organ3d.pins.json in `folder`."""
    example = clouds.tensors(pyramid.of(pinned_points()))
    axes = {name: {0: "n" + (name[-1] if name[-1].isdigit() else "")} for name in (*INPUTS, *OUTPUTS)}
    torch.onnx.export(
        network.eval(), tuple(example[name] for name in INPUTS), str(folder / "organ3d.onnx"), opset_version=17,
        input_names=list(INPUTS), output_names=list(OUTPUTS), dynamic_axes=axes | {"local": {0: "n1"}},
    )
    inputs = [(name, port_shape(name), "f32" if example[name].is_floating_point() else "i64") for name in INPUTS]
    outputs = [(name, [-1, columns], "f32") for name, columns in OUTPUTS.items()]
    normalisation = "recon/src/pyramid.rs makes the inputs: coordinates in cells of level 1, indices by level"
    write_manifest(folder / "organ3d.toml", version, normalisation, inputs, outputs, provenance)
    write_pins(network, example, folder / "organ3d.pins.json")


def port_shape(name):
    if name.startswith("points"):
        return [-1, 3]
    return [-1, COLUMNS[name]] if name in COLUMNS else [-1]


def pinned_points():
    """Point i lies at the fractions of i i times three irrational numbers: no two distances agree, so that nearest
    neighbours are the same everywhere."""
    i = np.arange(PINNED_POINTS, dtype=float)
    return np.column_stack([(i * i * k) % 1 for k in (0.618033988749895, 0.7548776662466927, 0.5698402909980532)])


def write_pins(network, example, path):
    """What PyTorch computes in single precision at some points."""
    with torch.no_grad():
        outputs = dict(zip(OUTPUTS, network.eval()(**example)))
    asked = np.random.default_rng(0).integers(PINNED_POINTS, size=PINS)
    pins = [{"at": int(i)} | {name: output[i].tolist() for name, output in outputs.items()} for i in asked]
    lines = ",\n  ".join(json.dumps(pin) for pin in pins)
    path.write_text(f'{{"points": {PINNED_POINTS}, "pins": [\n  {lines}\n]}}\n')
