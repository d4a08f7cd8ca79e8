#!/usr/bin/env python3
"""Labelled plants with known truth from PyPI's pyhelios3d, for `demeter eval` and `demeter learn`.

Install: python3 -m venv .cache/helios && .cache/helios/bin/pip install -r tools/helios/requirements.txt
Run:     .cache/helios/bin/python tools/helios/grow.py --species soybean --seed 1 --age 20 -o FOLDER

FOLDER/SPECIES_SEED_AGE.ply (binary little endian, metres, z up) holds points uniform by area on the solid surface:
x, y, z (float); label (int: 0 every stem, 1..n one blade each, a leaflet being a blade); organ (int: id in the JSON);
kind (uchar: 0 main stem, 1 branch, petiole or petiolule, 2 blade). The JSON beside it holds the truth: the plant's
height, leaf area, node positions and internode lengths on the main stem, and each organ with its parent. Petiolules,
of a centimetre at most, are part of their petiole. With --noise-mm each coordinate gets Gaussian noise of that standard
deviation; with --missing that share of points is lost, half of it by occlusion from one side, the rest in holes, and
each blade's `visible` is the share of its points that stayed.
"""

import argparse
import json
from pathlib import Path

import numpy as np

from cloud import missing, sample
from plant import BLADE, grow

KINDS = ["main_stem", "stem", "blade"]
VERTEX = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("label", "<i4"), ("organ", "<i4"), ("kind", "u1")])


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--species", required=True, help="soybean, maize, bean, sorghum, cowpea, tomato, pepper...")
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--age", type=float, required=True, help="days")
    parser.add_argument("--points", type=int, default=50_000, help="before any go missing")
    parser.add_argument("--noise-mm", type=float, default=0.0)
    parser.add_argument("--missing", type=float, default=0.0, help="share of points lost, 0 to 0.9")
    parser.add_argument("-o", "--output", type=Path, required=True)
    return parser.parse_args()


def described(organ, total, kept):
    """An organ as the JSON has it. `total` and `kept` are its points before and after any went missing."""
    told = {
        "id": organ.id, "kind": KINDS[organ.kind], "role": organ.role,
        "parent": None if organ.parent < 0 else organ.parent,
        "attach": organ.attach, "length": organ.length, "base": organ.axis[0].tolist(), "tip": organ.axis[-1].tolist(),
        "points": int(kept), "visible": float(kept / total) if total else 0.0,
    }
    if organ.kind == BLADE:
        return told | {"label": organ.label, "leaf": organ.leaf, "area": organ.area, "inclination": organ.inclination}
    return told | {"radius": organ.radius}


def write_ply(path, points, organ, organs):
    """Whole or not at all: written beside, then renamed. `organ` [count] says which of `organs` each point lies on."""
    vertices = np.zeros(len(points), VERTEX)
    vertices["x"], vertices["y"], vertices["z"] = points.T
    vertices["organ"] = organ
    vertices["label"] = np.array([o.label for o in organs])[organ]
    vertices["kind"] = np.array([o.kind for o in organs])[organ]
    types = {"<f4": "float", "<i4": "int", "|u1": "uchar"}
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(vertices)}"]
    header += [f"property {types[VERTEX[field].str]} {field}" for field in VERTEX.names]
    part = path.with_suffix(".part")
    part.write_bytes("\n".join([*header, "end_header\n"]).encode() + vertices.tobytes())
    part.replace(path)


def main():
    args = arguments()
    plant = grow(args.species, args.seed, args.age)
    random = np.random.default_rng([args.seed, int(args.age * 1000)])
    points, faces = sample(plant, args.points, random)
    low, high = points.min(0), points.max(0)
    organ = plant.organ[faces]
    lost, view = np.zeros(len(points), bool), None
    if args.missing > 0:
        lost, view = missing(plant, points, min(args.missing, 0.9), random)
    count = lambda which: np.bincount(organ[which], minlength=len(plant.organs))
    total, kept = count(np.ones_like(lost)), count(~lost)
    points += random.normal(size=points.shape) * (args.noise_mm / 1000)

    truth = {
        "species": args.species, "seed": args.seed, "age_days": args.age, "points": int((~lost).sum()),
        "noise_m": args.noise_mm / 1000, "missing": float(lost.mean()),
        "view": None if view is None else view.tolist(),
        "height": float(high[2] - low[2]),
        "leaf_area": sum(o.area for o in plant.organs if o.kind == BLADE),
        "nodes": plant.nodes, "internode_lengths": np.diff([0.0, *plant.nodes]).tolist(),
        "organs": [described(o, total[o.id], kept[o.id]) for o in plant.organs],
    }
    args.output.mkdir(parents=True, exist_ok=True)
    name = args.output / f"{args.species}_{args.seed}_{args.age:g}"
    write_ply(name.with_name(name.name + ".ply"), points[~lost], organ[~lost], plant.organs)
    name.with_name(name.name + ".json").write_text(json.dumps(truth, indent=1) + "\n")


if __name__ == "__main__":
    main()
