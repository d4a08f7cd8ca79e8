#!/usr/bin/python3
"""Labelled seedlings for organ3d: what the grown-up plants of the generators and of our species models lack.

    /usr/bin/python3 models/training/seedlings.py --count 600 --seed 5000 -o DIR

Seen in scans of real ones: two to six organs; thick stems, in grasses the tube of the sheaths; blades that wrap the stem
at their base, or are rolled up whole and go on where the stem ends; sharp bends; plants that lie and rise again; clusters
of unfolding leaves. All proportions here are guesses, wide on purpose. Files are those of tools/helios/grow.py, lengths in
stem lengths.
"""

import argparse
import json
import pathlib

import numpy as np

MAIN_STEM, STEM, BLADE = 0, 1, 2
VERTEX = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("label", "<i4"), ("organ", "<i4"), ("kind", "u1")])
ALONG, ACROSS, AROUND = 40, 16, 12
UP = np.array([0.0, 0.0, 1.0])


class Plant:
    """Grids of points [s, u, 3], one an organ, with their kinds."""

    def __init__(self):
        self.grids, self.kinds = [], []

    def add(self, kind, grid):
        self.grids.append(grid)
        self.kinds.append(kind)

    def sample(self, count, random):
        """`count` points uniform by area, and the organ of each."""
        corners, organ = [], []
        for k, g in enumerate(self.grids):
            a, b, c, d = g[:-1, :-1], g[1:, :-1], g[1:, 1:], g[:-1, 1:]
            both = np.concatenate([np.stack([a, b, c], 2).reshape(-1, 3, 3), np.stack([a, c, d], 2).reshape(-1, 3, 3)])
            corners.append(both)
            organ.append(np.full(len(both), k))
        corners, organ = np.concatenate(corners), np.concatenate(organ)
        area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
        face = random.choice(len(area), count, p=area / area.sum())
        root, v = np.sqrt(random.random(count)), random.random(count)
        weights = np.stack([1 - root, root * (1 - v), root * v], 1)
        return (corners[face] * weights[:, :, None]).sum(1), organ[face]


def tube(line, radius):
    """A tube about a line [s,3] of radii [s]."""
    tangent = np.gradient(line, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    side = np.cross(tangent, [0.8, 0.6, 0.01])
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    angle = np.linspace(0, 2 * np.pi, AROUND)[None, :, None]
    ring = np.cos(angle) * side[:, None] + np.sin(angle) * np.cross(tangent, side)[:, None]
    return line[:, None] + ring * np.asarray(radius)[:, None, None]


def rib(random, start, azimuth, inclination, length, bend):
    """The line of a midrib or petiole that leaves `start` at an inclination from the vertical and bends on by `bend` to
    its tip, sometimes sharply: points [s,3] and their frames (tangent, to the right, to the upper side)."""
    s = np.linspace(0, 1, ALONG)
    angle = inclination + bend * s ** random.uniform(0.7, 2.5)
    if random.random() < 0.35:
        angle = angle + random.normal(0, 0.7) / (1 + np.exp((random.uniform(0.2, 0.9) - s) * 40))
    around = azimuth + random.normal(0, 0.4) * s
    out = np.stack([np.cos(around), np.sin(around), np.zeros(ALONG)], 1)
    tangent = np.sin(angle)[:, None] * out + np.cos(angle)[:, None] * UP
    right = np.cross(UP, out)
    line = start + np.concatenate([np.zeros((1, 3)), np.cumsum((tangent[1:] + tangent[:-1]) / 2, 0)]) * length / (ALONG - 1)
    return line, (tangent, right, np.cross(tangent, right))


def blade(random, ribs, width, curvature):
    """A surface across a midrib: `width` [s] is its arc, `curvature` [s] bends it to the upper side; twisted, waved."""
    line, (tangent, right, upper) = ribs
    s = np.linspace(0, 1, ALONG)
    twist = (random.normal(0, 0.5) * s**1.5)[:, None]
    right, upper = np.cos(twist) * right + np.sin(twist) * upper, np.cos(twist) * upper - np.sin(twist) * right
    u = width[:, None] * np.linspace(-0.5, 0.5, ACROSS)
    bent = np.clip(u * curvature[:, None], -np.pi, np.pi)
    ratio = np.where(np.abs(bent) > 1e-6, bent, 1e-6)
    sideways, inwards = u * np.sin(ratio) / ratio, u * (1 - np.cos(ratio)) / ratio
    wave = random.normal(0, 0.16) * np.sin(s * random.uniform(6, 30) + random.uniform(0, 6))[:, None] * np.abs(u)
    return line[:, None] + sideways[:, :, None] * right[:, None] + (inwards + wave)[:, :, None] * upper[:, None]


def outline(random, slim):
    """Widths along a blade, 1 at the widest: narrow at both ends; `slim` grasses stay wide for long."""
    s = np.linspace(0, 1, ALONG)
    widest = random.uniform(0.25, 0.6)
    power = random.uniform(0.5, 1.2) if slim else random.uniform(0.7, 1.4)
    return np.sin(np.pi * s ** (np.log(0.5) / np.log(widest))) ** power


def grass(random):
    """A grass: its sheaths are the main stem; blades wrap it at their base."""
    plant, s = Plant(), np.linspace(0, 1, ALONG)
    radius = np.exp(random.uniform(np.log(0.012), np.log(0.07)))
    leaves = random.integers(1, 7)
    first = random.uniform(0.15, 0.9)
    heights = np.sort(random.uniform(first, 1, leaves))
    heights[-1] = 1.0
    taper = 1 - random.uniform(0, 0.4) * s
    plant.add(MAIN_STEM, tube(s[:, None] * UP, radius * taper))
    azimuth = random.uniform(0, 2 * np.pi)
    for k, height in enumerate(heights):
        young = leaves > 1 and (k == leaves - 1 or k == leaves - 2 and random.random() < 0.3)
        azimuth += np.pi + random.normal(0, 0.35)
        out = np.array([np.cos(azimuth), np.sin(azimuth), 0])
        at = radius * np.interp(height, s, taper) * random.uniform(0.8, 1.1)
        inclination = abs(random.normal(0, 0.08 if young else 0.3))
        bend = random.uniform(-0.1, 0.5) if young and random.random() < 0.7 else random.uniform(0, 2.6)
        length = random.uniform(0.3, 1.2) if young else np.exp(random.uniform(np.log(0.15), np.log(2.5)))
        widest = length * (random.uniform(0.04, 0.2) if length > 0.5 else random.uniform(0.1, 0.5))
        # The arc at the base covers part of the stem, or all of it; further up the blade opens, young ones late.
        wrapped = min(2 * np.pi * at * random.uniform(0.3, 1.0), 2.5 * widest)
        width = np.maximum(outline(random, True) * widest, wrapped * np.clip(1 - s * random.uniform(2, 12), 0, 1))
        opening = random.uniform(0.3, 3.0) if young else random.uniform(0.02, 0.4)
        curvature = np.exp(-s / opening) / at + random.uniform(0, 1.5) / max(widest, 1e-3)
        if random.random() < 0.3:
            # Thin dry tips and edges roll up.
            curvature = curvature + s ** random.uniform(1, 4) * random.uniform(1, 6) / max(widest, 1e-3)
        ribs = rib(random, out * at + UP * height, azimuth, inclination, length, bend)
        plant.add(BLADE, blade(random, ribs, np.maximum(width, 0.002), curvature))
    return plant


def broadleaf(random):
    """A broadleaf: petioles, or blades that narrow to the stem; simple or compound; a cluster unfolds at the top."""
    plant, s = Plant(), np.linspace(0, 1, ALONG)
    radius = np.exp(random.uniform(np.log(0.008), np.log(0.045)))
    plant.add(MAIN_STEM, tube(s[:, None] * UP, radius * (1 - random.uniform(0, 0.5) * s)))
    compound, sessile = random.random() < 0.4, random.random() < 0.25
    size = np.exp(random.uniform(np.log(0.15), np.log(1.2)))
    azimuth = random.uniform(0, 2 * np.pi)
    places = [(0.3 * random.uniform(0.3, 2), 0.5, True)] * random.integers(0, 2)
    places += [(h, random.uniform(0.5, 1.3), False) for h in np.sort(random.uniform(0.25, 1, random.integers(1, 7)))]
    places += [(random.uniform(0.97, 1), random.uniform(0.08, 0.4), False) for _ in range(random.integers(0, 5))]
    for height, relative, pair in places:
        for turn in (0, np.pi) if pair else (0,):
            azimuth += np.pi if pair else 2.4 + random.normal(0, 0.5)
            _leaf(random, plant, height, azimuth, size * relative, radius, compound and not pair, sessile)
    return plant


def _leaf(random, plant, height, azimuth, size, radius, compound, sessile):
    s = np.linspace(0, 1, ALONG)
    inclination = random.uniform(0.2, 1.4)
    start, at = UP * height, inclination
    thin = radius * random.uniform(0.25, 0.7) * (0.5 + 0.5 * min(size, 1))
    if not sessile:
        length = size * random.uniform(0.3, 1.5)
        line, frame = rib(random, start, azimuth, inclination, length, random.uniform(-0.4, 0.6))
        # A petiole shorter than it is thick is no organ of its own.
        if length > 4 * thin:
            plant.add(STEM, tube(line, thin * (1 - 0.3 * s)))
        start, at = line[-1], np.arccos(np.clip(frame[0][-1, 2], -1, 1))
    leaflets = [(1.0, 0.0, 1.0)]
    if compound and not sessile:
        for k in range(random.integers(1, 4)):
            place = random.uniform(0.35, 0.95)
            leaflets += [(place, side * random.uniform(0.9, 1.5), random.uniform(0.4, 1)) for side in (-1, 1)]
    for place, turn, relative in leaflets:
        root = start if place == 1 else line[int(place * (ALONG - 1))]
        ribs = rib(random, root, azimuth + turn, at + random.normal(0, 0.2), size * relative, random.uniform(-0.3, 1.4))
        width = outline(random, False) * size * relative * random.uniform(0.25, 0.9)
        if sessile:
            width = np.maximum(width, 2 * thin * (1 - s))
        cup = random.uniform(-0.3, 1.0) if random.random() < 0.7 else random.uniform(1, 5)
        plant.add(BLADE, blade(random, ribs, np.maximum(width, 0.002), np.full(ALONG, cup / (size * relative))))


def leant(points, random):
    """The plant along a bent line in place of the vertical: it leans, or lies and rises again."""
    lean = abs(random.normal(0, 0.15)) + (random.uniform(0, 1.5) if random.random() < 0.25 else 0)
    z = np.linspace(0, max(1.0, points[:, 2].max()), 60)
    angle = lean + random.normal(0, 0.3) * z + random.normal(0, 0.1) * np.sin(z * random.uniform(2, 9))
    if lean > 0.5:
        angle = angle * np.clip(1.3 - z * random.uniform(0, 1), 0, 1.3)
    step = np.diff(z, prepend=0)
    right, up = np.cumsum(np.sin(angle) * step), np.cumsum(np.cos(angle) * step)
    height = np.clip(points[:, 2], 0, None)
    tilt = np.interp(height, z, angle)
    below = np.minimum(points[:, 2], 0)
    x = np.interp(height, z, right) + points[:, 0] * np.cos(tilt) + below * np.sin(tilt)
    return np.column_stack([x, points[:, 1], np.interp(height, z, up) - points[:, 0] * np.sin(tilt) + below * np.cos(tilt)])


def write(path, points, organ, kinds):
    vertices = np.zeros(len(points), VERTEX)
    vertices["x"], vertices["y"], vertices["z"] = points.T
    vertices["organ"], vertices["kind"] = organ, np.array(kinds)[organ]
    vertices["label"] = np.cumsum(np.array(kinds) == BLADE)[organ] * (vertices["kind"] == BLADE)
    types = {"<f4": "float", "<i4": "int", "|u1": "uchar"}
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(vertices)}"]
    header += [f"property {types[VERTEX[field].str]} {field}" for field in VERTEX.names]
    path.write_bytes("\n".join([*header, "end_header\n"]).encode() + vertices.tobytes())


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, required=True)
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--points", type=int, default=14_000, help="points a plant")
    parser.add_argument("-o", "--output", type=pathlib.Path, required=True)
    args = parser.parse_args()
    args.output.mkdir(parents=True, exist_ok=True)
    for k in range(args.count):
        random = np.random.default_rng([args.seed, k])
        plant = (grass if k % 2 else broadleaf)(random)
        points, organ = plant.sample(args.points, random)
        write(args.output / f"{('broadleaf', 'grass')[k % 2]}_{k:05}.ply", leant(points, random), organ, plant.kinds)
    made = {"seed": args.seed, "program": f"seedlings.py, NumPy {np.__version__}"}
    (args.output / "meta.json").write_text(json.dumps(made) + "\n")


if __name__ == "__main__":
    main()
