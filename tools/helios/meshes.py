#!/usr/bin/env python3
"""Labelled meshes of many plants, and pictures of leaves, for `demeter synth images --assets FOLDER`.

Run: .cache/helios/bin/python tools/helios/meshes.py --each 30 --seed 6000 [--leaflets ../shared/data/soybean-leaflets] \
         -o FOLDER

FOLDER/plants/SPECIES_SEED.safetensors: one plant, metres, z up, standing at the origin. positions and normals [V,3] f32;
uvs [V,2] f32, v downwards in the picture; faces [F,3] u32; organ [F] u16, an organ's index; kind [O] u8, 1 leaf, 2 stem,
3 main stem; texture [O] i16, an index into the metadata's `textures` (names separated by spaces, of files in
FOLDER/textures), -1 for none. Where a texture's alpha is below one half there is no leaf.
FOLDER/textures/*.png: the generator's leaf scans with alpha, smaller.
FOLDER/blades/{broad,grass}_*.png: scans straightened, the base's row first, each row the blade from margin to margin,
transparent where insects ate: what the blades of our own plants look like.

Plant k of a species has seed SEED + k and an age drawn from that seed. A plant whose file is there already is not grown
again, so a stopped run continues; meta.json comes last.
"""

import argparse
import json
from importlib.metadata import version
from pathlib import Path

import numpy as np
from PIL import Image

from plant import BLADE, MAIN_STEM, grow

# First and last age in days: from a few leaves on, until a plant of this generator takes seconds to build. The last are
# weeds; the generator's bindweed and cheeseweed have leaves without a scan, which plant.py does not read.
AGES = {
    "sugarbeet": (8, 50), "maize": (12, 55), "soybean": (8, 34), "sorghum": (12, 55), "bean": (6, 24), "cowpea": (6, 24),
    "tomato": (5, 28), "pepper": (15, 65), "strawberry": (8, 40), "wheat": (10, 45),
    "groundcherryweed": (8, 35), "puncturevine": (4, 14), "butterlettuce": (8, 30),
}
TEXTURE_SIDE = 192
BLADE_SIZE = (64, 128)
# Scanned leaflets lie on white: what is lighter than this in all colours is a hole.
HOLE = 170
# The semantic classes of demeter-frame, by the kinds of plant.py.
SEMANTIC = {MAIN_STEM: 3, BLADE: 1}
STEM_SEMANTIC = 2


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--each", type=int, required=True, help="plants of each species")
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--leaflets", type=Path, help="a folder with rgb/ and mask/ of scanned leaflets, base at the top")
    parser.add_argument("-o", "--output", type=Path, required=True)
    return parser.parse_args()


def indexed(plant):
    """The plant's triangles with shared corners: positions, normals, uvs, faces, organ of each face."""
    uv = plant.uv * [1, -1] + [0, 1]
    organ = np.repeat(plant.organ, 3)
    corners, uvs = plant.corners.reshape(-1, 3), uv.reshape(-1, 2)
    across = np.cross(plant.corners[:, 1] - plant.corners[:, 0], plant.corners[:, 2] - plant.corners[:, 0])
    # Corners of one organ at one place, to a hundredth of a millimetre, share a normal: the sum of their faces' areas.
    place = np.column_stack([organ, np.round(corners * 1e5)]).astype(np.int64)
    _, at = np.unique(place, axis=0, return_inverse=True)
    sums = np.zeros((at.max() + 1, 3))
    np.add.at(sums, at.ravel(), np.repeat(across, 3, axis=0))
    normals = sums[at.ravel()]
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    key = np.column_stack([place, np.round(uvs * 1e4).astype(np.int64)])
    _, first, faces = np.unique(key, axis=0, return_index=True, return_inverse=True)
    return corners[first], normals[first], uvs[first], faces.reshape(-1, 3), plant.organ


def write_plant(path, plant):
    """The plant as safetensors; returns the textures that it shows."""
    positions, normals, uvs, faces, organ = indexed(plant)
    paths = sorted(set(plant.texture) - {""})
    texture = np.full(len(plant.organs), -1, "<i2")
    for k, file in enumerate(paths):
        # A leaf object has one texture; petiolules, which have none, belong to stems.
        texture[np.unique(plant.organ[plant.texture == file])] = k
    kind = np.array([SEMANTIC.get(o.kind, STEM_SEMANTIC) for o in plant.organs], "u1")
    tensors = {
        "positions": positions.astype("<f4"), "normals": normals.astype("<f4"), "uvs": uvs.astype("<f4"),
        "faces": faces.astype("<u4"), "organ": organ.astype("<u2"), "kind": kind, "texture": texture,
    }
    names = {"<f4": "F32", "<u4": "U32", "<u2": "U16", "|u1": "U8", "<i2": "I16"}
    header, end = {"__metadata__": {"textures": " ".join(Path(file).stem + ".png" for file in paths)}}, 0
    for name, tensor in tensors.items():
        header[name] = {"dtype": names[tensor.dtype.str], "shape": tensor.shape, "data_offsets": [end, end + tensor.nbytes]}
        end += tensor.nbytes
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 8)
    part = path.with_suffix(".part")
    part.write_bytes(len(text).to_bytes(8, "little") + text + b"".join(t.tobytes() for t in tensors.values()))
    part.rename(path)
    return paths


def write_texture(folder, file):
    image = Image.open(file).convert("RGBA")
    image.thumbnail((TEXTURE_SIDE, TEXTURE_SIDE))
    image.save(folder / "textures" / (Path(file).stem + ".png"))
    texels = np.asarray(Image.open(file).convert("RGBA"))
    # The generator's leaves point to the right; ours begin with the base's row.
    turned = texels.transpose(1, 0, 2)
    sort = "grass" if turned.shape[0] > 4 * turned.shape[1] else "broad"
    write_blade(folder / "blades" / f"{sort}_{Path(file).stem}.png", turned[..., :3], turned[..., 3] > 127)


def write_blade(path, rgb, solid):
    """The picture of a leaf with each of its rows stretched from margin to margin, holes transparent."""
    # A stub of petiole is no blade: only rows at least a tenth as wide as the widest count.
    width = solid.sum(1)
    rows = np.flatnonzero(width >= 0.1 * width.max())
    straight = np.full((len(rows), BLADE_SIZE[0], 4), 255, np.uint8)
    for k, row in enumerate(rows):
        columns = np.flatnonzero(solid[row])
        # A pixel inside the margin, whose colour is mixed with the background's.
        inner = columns[2:-2] if len(columns) > 8 else columns
        straight[k, :, :3] = rgb[row, inner[np.linspace(0, len(inner) - 1, BLADE_SIZE[0]).astype(int)]]
    straight[..., 3] = np.where((straight[..., :3] > HOLE).all(-1), 0, 255)
    Image.fromarray(straight).resize(BLADE_SIZE, Image.NEAREST).save(path)


def main():
    args = arguments()
    for name in ("plants", "textures", "blades"):
        (args.output / name).mkdir(parents=True, exist_ok=True)
    if args.leaflets:
        for file in sorted((args.leaflets / "rgb").iterdir()):
            mask = next((args.leaflets / "mask").glob(file.stem + ".*"), None)
            if mask is None:
                continue
            rgb = Image.open(file).convert("RGB")
            solid = np.asarray(Image.open(mask).convert("L").resize(rgb.size)) > 127
            # A mask of which the leaf fills less than a sixth or nearly all is a poor one.
            if 0.15 < solid.mean() < 0.9:
                write_blade(args.output / "blades" / f"broad_{file.stem}.png", np.asarray(rgb), solid)
    for k in range(args.each):
        for species, ages in AGES.items():
            path = args.output / "plants" / f"{species}_{args.seed + k}.safetensors"
            if path.exists():
                continue
            random = np.random.default_rng([args.seed + k, *species.encode()])
            plant = grow(species, args.seed + k, float(random.uniform(*ages)))
            for file in write_plant(path, plant):
                if not (args.output / "textures" / (Path(file).stem + ".png")).exists():
                    write_texture(args.output, file)
            print(path, len(plant.organ), flush=True)
    made = {
        "program": f"tools/helios/meshes.py, pyhelios3d {version('pyhelios3d')}", "seed": args.seed, "each": args.each,
        "species": sorted(AGES), "leaflets": args.leaflets is not None,
    }
    (args.output / "meta.json").write_text(json.dumps(made) + "\n")


if __name__ == "__main__":
    main()
