"""organ2d and relief2d as ONNX, their manifests and their pins (values that Rust must find again)."""

import json

import numpy as np
import torch

from export import write_manifest
from network import Depth, Relief2d

PINNED_HEIGHT, PINNED_WIDTH, PINS_A_CHANNEL = 64, 96, 9
INPUTS = {"image": [3, -1, -1]}
OUTPUTS = {
    "organ2d": {"sem": [4, -1, -1], "dist": [1, -1, -1], "depth": [1, -1, -1], "camera": [6]},
    "relief2d": {"depth": [1, -1, -1]},
}


def write(network, folder, version, provenance):
    """NAME.onnx, NAME.toml and NAME.pins.json in `folder`; the name is the network's class, in small letters."""
    name = type(network).__name__.lower()
    network = Depth(network) if isinstance(network, Relief2d) else network
    write_onnx(network, folder / f"{name}.onnx", OUTPUTS[name])
    ports = lambda them: [(name, [-1, *sides], "f32") for name, sides in them.items()]
    normalisation = "inside the graph: give RGB in 0..1, sides multiples of 16"
    write_manifest(folder / f"{name}.toml", version, normalisation, ports(INPUTS), ports(OUTPUTS[name]), provenance)
    write_pins(network, folder / f"{name}.pins.json", OUTPUTS[name])


def write_onnx(network, path, outputs):
    """Opset 17; n, h and w are the caller's. Batch normalisation is folded into the convolutions."""
    axes = {name: {0: "n"} for name in INPUTS | outputs}
    for name in axes.keys() - {"camera"}:
        axes[name] |= {2: "h", 3: "w"}
    torch.onnx.export(
        network.eval(), torch.rand(1, 3, PINNED_HEIGHT, PINNED_WIDTH), str(path), opset_version=17,
        input_names=list(INPUTS), output_names=list(outputs), dynamic_axes=axes,
    )


def pinned_image():
    """pixel (c, y, x) = ((x x (c + 1) + y y (3 - c) + 17 x y) mod 251) / 250: whole numbers, so the same everywhere."""
    c, y, x = np.meshgrid(np.arange(3), np.arange(PINNED_HEIGHT), np.arange(PINNED_WIDTH), indexing="ij")
    return ((x * x * (c + 1) + y * y * (3 - c) + 17 * x * y) % 251).astype(np.float32) / np.float32(250)


def write_pins(network, path, outputs):
    """What PyTorch computes in single precision at some places of each output channel."""
    with torch.no_grad():
        found = network.eval()(torch.from_numpy(pinned_image())[None])
    random = np.random.default_rng(0)
    pins = []
    for name, output in zip(outputs, [found] if torch.is_tensor(found) else found):
        for c in range(output.shape[1]):
            for _ in range(PINS_A_CHANNEL if output.ndim == 4 else 1):
                at = [c, *(int(random.integers(side)) for side in output.shape[2:])]
                pins.append({"output": name, "at": at, "value": float(output[(0, *at)])})
    lines = ",\n  ".join(json.dumps(pin) for pin in pins)
    path.write_text(f'{{"height": {PINNED_HEIGHT}, "width": {PINNED_WIDTH}, "pins": [\n  {lines}\n]}}\n')
