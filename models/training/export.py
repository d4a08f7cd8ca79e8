"""A trained network's manifest: what models/src/manifest.rs reads."""

import hashlib
import json


def write_manifest(path, version, normalisation, inputs, outputs, provenance):
    """`path` NAME.toml beside NAME.onnx, of layout NAME; ports as (name, shape, dtype), -1 for the caller's sides;
    `provenance`: command, seed, steps, program, data (a list of dicts), figures."""

    def table(values):
        return "{ " + ", ".join(f"{key} = {json.dumps(value)}" for key, value in values.items()) + " }"

    def ports(them):
        one = lambda name, shape, dtype: table({"name": name, "shape": shape, "dtype": dtype})
        return "[" + ", ".join(one(*port) for port in them) + "]"

    sha256 = hashlib.sha256(path.with_suffix(".onnx").read_bytes()).hexdigest()
    data = ",\n".join("  " + table(folder) for folder in provenance["data"])
    figures = "\n".join(f"{key} = {value}" for key, value in provenance["figures"].items())
    path.write_text(
        f'name = "{path.stem}"\nversion = {json.dumps(version)}\nlayout = "{path.stem}"\nsha256 = "{sha256}"\n'
        f"normalisation = {json.dumps(normalisation)}\ninputs = {ports(inputs)}\noutputs = {ports(outputs)}\n\n"
        f'[provenance]\ncommand = {json.dumps(provenance["command"])}\nseed = {provenance["seed"]}\n'
        f'steps = {provenance["steps"]}\nprogram = {json.dumps(provenance["program"])}\n'
        f"data = [\n{data}\n]\n\n"
        f"# On the 3 % of each data set that were not trained on.\n[provenance.figures]\n{figures}\n"
    )
