"""Labelled clouds for organ3d: read once, prepared, spoiled as scans are.

A folder holds PLY files of `tools/helios/flock.py` or `demeter synth clouds`: x, y, z, organ, and kind (0 main stem,
1 stem or petiole, 2 blade). Prepared clouds are kept beside the checkpoints, by the hash of their file.
"""

import hashlib
import json
import pathlib

import numpy as np
import torch
from scipy.spatial import cKDTree

import pyramid

# Kind in the files (main stem, stem, blade) -> class of the network (leaf, stem, main stem).
CLASS_OF_KIND = np.array([2, 1, 0])
LEAF = 0
# Delta of the truncated inverse distance, as a share of the bounding box's diagonal (spec/reconstruction.md).
DELTA = 0.01
TYPES = {"float": "<f4", "double": "<f8", "int": "<i4", "uint": "<u4", "uchar": "u1"}
# Median radius of stems to which they are thinned or thickened, as a share of the diagonal: of a maize plant with ten
# leaves and of a seedling with two.
THIN_STEM, THICK_STEM = 0.003, 0.025
# Points of one sample at which the network is asked while it learns.
ASKED = 4096
# Cells of level 1 that a sample has at least to have when it has fewer than in use.
FEWEST_CELLS = 700


def read_ply(path):
    """The vertices of a little-endian binary PLY."""
    header, _, body = pathlib.Path(path).read_bytes().partition(b"end_header\n")
    lines = [line.split() for line in header.decode().splitlines()]
    count = next(int(line[2]) for line in lines if line[:2] == ["element", "vertex"])
    return np.frombuffer(body, np.dtype([(line[2], TYPES[line[1]]) for line in lines if line[0] == "property"]), count)


def distance_to_others(points, organ):
    """Distance from each point to the nearest one of another organ; far ones to a tenth of the points only."""
    found, near = cKDTree(points).query(points, k=min(32, len(points)))
    other = organ[near] != organ[:, None]
    distance = np.where(other.any(1), found[np.arange(len(points)), other.argmax(1)], np.inf)
    few = np.arange(0, len(points), 10)
    for part in np.array_split(np.flatnonzero(~other.any(1)), 32):
        apart = torch.cdist(torch.from_numpy(points[part]), torch.from_numpy(points[few])).numpy()
        apart[organ[part][:, None] == organ[few]] = np.inf
        distance[part] = apart.min(1, initial=np.inf)
    return distance


def axis_points(points, organ, kind):
    """For each point of a stem the nearest point of that stem's axis, else itself: the mean of the organ's points about
    as far along its longest direction. Good for stems that are nearly straight over a tenth of their length."""
    axis = points.copy()
    for o in np.unique(organ[kind < 2]):
        own = np.flatnonzero((organ == o) & (kind < 2))
        if len(own) < 20:
            continue
        centred = points[own] - points[own].mean(0)
        direction = np.linalg.eigh(centred.T @ centred)[1][:, 2]
        along = centred @ direction
        own, along = own[np.argsort(along)], np.sort(along)
        window = np.ptp(along) / 30
        first, last = np.searchsorted(along, along - window), np.searchsorted(along, along + window, "right")
        sums = np.cumsum(np.column_stack([points[own], along]), 0)
        sums = np.concatenate([np.zeros((1, 4)), sums])
        mean = (sums[last] - sums[first]) / (last - first)[:, None]
        # At an end of the stem the window's middle lies further in: it is moved along the axis to the point's height.
        axis[own] = mean[:, :3] + (along - mean[:, 3])[:, None] * direction
    return axis


class Clouds:
    """The clouds of one folder; every 33rd of them is held out."""

    def __init__(self, folder, cache):
        self.folder = pathlib.Path(folder)
        self.paths = sorted(self.folder.glob("**/*.ply"))
        assert self.paths, f"{folder}: expected PLY files, found none"
        self.digests = [hashlib.sha256(path.read_bytes()).hexdigest() for path in self.paths]
        self.clouds = [self._prepared(path, cache / f"{d}.npz") for path, d in zip(self.paths, self.digests)]
        # Every 33rd: files are sorted by species, and each should be judged.
        self.held_out = list(range(16, len(self.paths), 33))
        self.taught = [i for i in range(len(self.paths)) if i not in set(self.held_out)]

    def _prepared(self, path, kept):
        if not kept.exists():
            v = read_ply(path)
            points = np.stack([v["x"], v["y"], v["z"]], 1).astype(np.float32)
            points -= points.mean(0)
            points /= np.linalg.norm(np.ptp(points, axis=0))
            distance = distance_to_others(points, v["organ"]).astype(np.float32)
            axis = axis_points(points, v["organ"], v["kind"]).astype(np.float32)
            kept.parent.mkdir(parents=True, exist_ok=True)
            with open(kept.with_suffix(".part"), "wb") as file:
                np.savez(file, points=points, distance=distance, axis=axis, sem=CLASS_OF_KIND[v["kind"]])
            kept.with_suffix(".part").replace(kept)
        with np.load(kept) as arrays:
            return {name: arrays[name] for name in arrays.files}

    def provenance(self):
        """For the manifest; meta.json beside the clouds says what made them."""
        meta = json.loads((self.folder / "meta.json").read_text())
        sha256 = hashlib.sha256("".join(self.digests).encode()).hexdigest()
        return {"samples": len(self.paths), "seed": meta["seed"], "program": meta["program"], "sha256": sha256}


def turned(points, random, tilt):
    """Rotation about the vertical and a tilt of `tilt` radians in a random direction."""
    a, b = random.uniform(0, 2 * np.pi, 2)
    spin = lambda t: np.array([[np.cos(t), -np.sin(t), 0], [np.sin(t), np.cos(t), 0], [0, 0, 1]])
    lean = np.array([[1, 0, 0], [0, np.cos(tilt), -np.sin(tilt)], [0, np.sin(tilt), np.cos(tilt)]])
    return points @ (spin(b) @ lean @ spin(a)).T


def seen(points, random, views):
    """Which points are in front, seen from `views` directions: what stands more than 1.5 % of the diagonal behind the
    first point of its pixel is hidden. Pixels of 0.7 to 1.5 %: a scan's beam is wider than the gaps between points."""
    visible = np.zeros(len(points), bool)
    for _ in range(views):
        azimuth, elevation = random.uniform(0, 2 * np.pi), random.uniform(-0.1, 1.3)
        view = np.array([np.cos(azimuth) * np.cos(elevation), np.sin(azimuth) * np.cos(elevation), np.sin(elevation)])
        right = np.array([-np.sin(azimuth), np.cos(azimuth), 0])
        flat = np.stack([points @ right, points @ np.cross(view, right)], 1)
        pixel = ((flat - flat.min(0)) / random.uniform(0.007, 0.015)).astype(np.int64)
        cell = pixel[:, 0] * 4096 + pixel[:, 1]
        _, cell = np.unique(cell, return_inverse=True)
        front = np.full(cell.max() + 1, -np.inf)
        np.maximum.at(front, cell, points @ view)
        visible |= points @ view > front[cell] - 0.015
    return visible


def spoiled(cloud, random):
    """A scan of the cloud: points [n,3], sem [n], distance [n] and the diagonal that distance is measured against."""
    points, axis = cloud["points"].astype(float), cloud["axis"].astype(float)
    sem, distance = cloud["sem"], cloud["distance"].astype(float)
    weight = np.ones(len(points))
    if random.random() < 0.6:
        # Seedlings have thick stems for their size, the generators' plants are grown up and thin.
        stems = sem != LEAF
        radius = np.median(np.linalg.norm(points - axis, axis=1)[stems]) if stems.any() else 1.0
        wanted = np.exp(random.uniform(np.log(THIN_STEM), np.log(THICK_STEM)))
        thicker = np.clip(wanted / max(radius, 1e-6), 0.5, 5)
        points = axis + (points - axis) * thicker
        weight[stems] = thicker
    stretch = np.exp(random.normal(0, 0.12, 3))
    points = turned(points * stretch, random, abs(random.normal(0, 0.12)))
    if random.random() < 0.5:
        # Leaves and stems wave: smooth displacement with a wavelength of some tenths of the plant.
        for _ in range(2):
            wave = random.normal(0, 1, 3) * random.uniform(4, 14)
            phase, reach = random.uniform(0, 6.3), random.normal(0, 0.12, 3) / np.linalg.norm(wave)
            points = points + np.sin(points @ wave + phase)[:, None] * reach
    if random.random() < 0.3:
        # A lying, leaning or bent plant.
        height = points[:, 2] - points[:, 2].min()
        points[:, :2] += (height**2)[:, None] * random.normal(0, 0.4, 2)
    keep = np.ones(len(points), bool)
    if random.random() < 0.45:
        keep = seen(points, random, random.integers(1, 4))
    size = np.linalg.norm(np.ptp(points, axis=0))
    for _ in range(random.integers(0, 6) if random.random() < 0.6 else 0):
        centre = points[random.integers(len(points))]
        keep &= np.linalg.norm(points - centre, axis=1) > random.uniform(0.01, 0.06) * size
    if random.random() < 0.15:
        # Part of a plant: cut by a plane.
        along = points @ random.normal(0, 1, 3)
        keep &= along < np.quantile(along, random.uniform(0.6, 0.95))
    if random.random() < 0.4:
        # A near side scanned more densely.
        along = points @ random.normal(0, 1, 3)
        along = (along - along.min()) / np.ptp(along)
        weight = weight * np.exp(random.uniform(0, 3) * along)
    count = int(np.exp(random.uniform(np.log(2500), np.log(14000))))
    chance = weight * keep
    chosen = random.random(len(points)) < chance * (count / max(chance.sum(), 1e-9))
    if chosen.sum() < 200:
        chosen = keep
    points, sem, distance = points[chosen], sem[chosen], distance[chosen]
    diagonal = np.linalg.norm(np.ptp(points, axis=0))
    points = points + random.normal(0, 1, points.shape) * diagonal * np.exp(random.uniform(np.log(2e-4), np.log(6e-3)))
    strays = random.random(len(points)) < random.choice([0, 0, 0.005, 0.02])
    points[strays] += random.normal(0, 0.03, (strays.sum(), 3)) * diagonal
    return points, sem, distance, np.linalg.norm(np.ptp(points, axis=0))


def sample(cloud, random):
    """The network's inputs, and the truth where it is asked: sem, t."""
    points, sem, distance, diagonal = spoiled(cloud, random)
    asked = random.permutation(len(points))[:ASKED]
    truth = DELTA / np.maximum(distance[asked] / diagonal, DELTA)
    # Fewer cells than when it is used teach as well in half the time, and that the network must not count on their size.
    cells = int(np.exp(random.uniform(np.log(FEWEST_CELLS), np.log(pyramid.MOST_CELLS))))
    return tensors(pyramid.of(points, points[asked], cells)), torch.from_numpy(sem[asked]), torch.from_numpy(truth).float()


def tensors(made):
    """The network's inputs by name, single precision."""
    arrays = {name: torch.from_numpy(np.ascontiguousarray(array)) for name, array in vars(made).items()}
    return {name: array.float() if array.is_floating_point() else array.long() for name, array in arrays.items()}


class Randomised(torch.utils.data.Dataset):
    """Sample i is always the same one."""

    def __init__(self, folders, seed, first):
        self.clouds = [folder.clouds[i] for folder in folders for i in folder.taught]
        self.seed, self.first = seed, first

    def __len__(self):
        return 1 << 40

    def __getitem__(self, i):
        random = np.random.default_rng((self.seed, self.first + i))
        return sample(self.clouds[random.integers(len(self.clouds))], random)
