"""The trained network as ONNX, its manifest and its pins (values that Rust must find again)."""

import hashlib
import json

import numpy as np
import torch

PINNED_HEIGHT, PINNED_WIDTH, PINS_A_CHANNEL = 64, 96, 9
PORTS = {"image": 3, "sem": 4, "dist": 1, "depth": 1}


def write_onnx(network, path):
    """Opset 17; n, h and w are the caller's. Batch normalisation is folded into the convolutions."""
    axes = {name: {0: "n", 2: "h", 3: "w"} for name in PORTS}
    torch.onnx.export(
        network.eval(), torch.rand(1, 3, PINNED_HEIGHT, PINNED_WIDTH), str(path), opset_version=17,
        input_names=["image"], output_names=["sem", "dist", "depth"], dynamic_axes=axes,
    )


def pinned_image():
    """pixel (c, y, x) = ((x x (c + 1) + y y (3 - c) + 17 x y) mod 251) / 250: whole numbers, so the same everywhere."""
    c, y, x = np.meshgrid(np.arange(3), np.arange(PINNED_HEIGHT), np.arange(PINNED_WIDTH), indexing="ij")
    return ((x * x * (c + 1) + y * y * (3 - c) + 17 * x * y) % 251).astype(np.float32) / np.float32(250)


def write_pins(network, path):
    """What PyTorch computes in single precision at some places of each output channel."""
    with torch.no_grad():
        outputs = network.eval()(torch.from_numpy(pinned_image())[None])
    random = np.random.default_rng(0)
    pins = []
    for name, output in zip(("sem", "dist", "depth"), outputs):
        for c in range(output.shape[1]):
            for _ in range(PINS_A_CHANNEL):
                y, x = int(random.integers(PINNED_HEIGHT)), int(random.integers(PINNED_WIDTH))
                pins.append({"output": name, "at": [c, y, x], "value": float(output[0, c, y, x])})
    lines = ",\n  ".join(json.dumps(pin) for pin in pins)
    path.write_text(f'{{"height": {PINNED_HEIGHT}, "width": {PINNED_WIDTH}, "pins": [\n  {lines}\n]}}\n')


def write_manifest(path, version, provenance):
    """`provenance`: command, seed, steps, program, data (a list of dicts), figures."""

    def table(values):
        return "{ " + ", ".join(f"{key} = {json.dumps(value)}" for key, value in values.items()) + " }"

    def ports(names):
        return "[" + ", ".join(table_of(name) for name in names) + "]"

    def table_of(name):
        return table({"name": name, "shape": [-1, PORTS[name], -1, -1], "dtype": "f32"})

    sha256 = hashlib.sha256(path.with_suffix(".onnx").read_bytes()).hexdigest()
    data = ",\n".join("  " + table(folder) for folder in provenance["data"])
    figures = "\n".join(f"{key} = {value}" for key, value in provenance["figures"].items())
    path.write_text(
        f'name = "organ2d"\nversion = {json.dumps(version)}\nlayout = "organ2d"\nsha256 = "{sha256}"\n'
        'normalisation = "inside the graph: give RGB in 0..1, sides multiples of 16"\n'
        f'inputs = {ports(["image"])}\noutputs = {ports(["sem", "dist", "depth"])}\n\n'
        f'[provenance]\ncommand = {json.dumps(provenance["command"])}\nseed = {provenance["seed"]}\n'
        f'steps = {provenance["steps"]}\nprogram = {json.dumps(provenance["program"])}\n'
        f"data = [\n{data}\n]\n\n"
        f"# On the last 3 % of each data set, which were not trained on.\n[provenance.figures]\n{figures}\n"
    )
