#!/usr/bin/env python3
"""Many labelled plants of all species and ages for training: see grow.py for the files, here without their JSON.

Run: .cache/helios/bin/python tools/helios/flock.py --each 80 --seed 5000 -o FOLDER

Plant k of a species has seed SEED + k and an age drawn from that seed. A plant whose file is there already is not grown
again, so a stopped run continues; meta.json comes last.
"""

import argparse
import json
from importlib.metadata import version
from pathlib import Path

import numpy as np

from cloud import sample
from grow import write_ply
from plant import grow

# First and last age in days: from a few leaves on, until a plant of this generator takes seconds to build.
AGES = {
    "soybean": (8, 32), "maize": (12, 52), "sorghum": (12, 55), "bean": (6, 24), "cowpea": (6, 24), "tomato": (5, 28),
    "pepper": (15, 65), "sugarbeet": (8, 45), "strawberry": (8, 40), "wheat": (10, 40),
}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--each", type=int, required=True, help="plants of each species")
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--points", type=int, default=20_000, help="points a plant")
    parser.add_argument("-o", "--output", type=Path, required=True)
    args = parser.parse_args()
    args.output.mkdir(parents=True, exist_ok=True)
    for k in range(args.each):
        for species, ages in AGES.items():
            path = args.output / f"{species}_{args.seed + k}.ply"
            if path.exists():
                continue
            random = np.random.default_rng([args.seed + k, *species.encode()])
            plant = grow(species, args.seed + k, float(random.uniform(*ages)))
            points, faces = sample(plant, args.points, random)
            write_ply(path, points, plant.organ[faces], plant.organs)
            print(path, flush=True)
    made = {"seed": args.seed, "program": f"tools/helios/flock.py, pyhelios3d {version('pyhelios3d')}"}
    (args.output / "meta.json").write_text(json.dumps(made) + "\n")


if __name__ == "__main__":
    main()
