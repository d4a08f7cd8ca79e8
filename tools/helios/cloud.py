"""Points on a plant's solid surface, and the ways in which a scan spoils them."""

import numpy as np

from plant import is_solid

# Share of the missing points that occlusion may take; the rest falls into holes.
OCCLUDED_SHARE = 0.5
# A point is hidden when something stands this far before it, seen from the viewpoint; a leaf's own slope within a pixel
# stays below it.
HIDDEN_BEHIND_M = 0.005
# Size of a pixel of the depth picture that finds hidden points, and the samples that fill it.
PIXEL_M = 0.0015
OCCLUDERS = 600_000
# Radius of the holes as a share of the plant's diagonal; a guess at what a leaf in the way or a lost patch leaves.
HOLE_SHARES = (0.01, 0.05)


def sample(plant, count, random):
    """`count` points uniform by solid area: positions [count,3] and triangles [count]."""
    points, faces = np.zeros((0, 3)), np.zeros(0, int)
    # A triangle is drawn by its whole area and the point kept when its texel is solid: uniform on what is solid.
    a, b, c = plant.corners.transpose(1, 0, 2)
    whole = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    share = whole / whole.sum()
    while len(points) < count:
        face = random.choice(len(share), size=count, p=share)
        root, v = np.sqrt(random.random(count)), random.random(count)
        weights = np.stack([1 - root, root * (1 - v), root * v], 1)
        keep = np.ones(count, bool)
        uv = (plant.uv[face] * weights[:, :, None]).sum(1)
        for texture in set(plant.texture) - {""}:
            on = plant.texture[face] == texture
            keep[on] = is_solid(texture, uv[on])
        place = (plant.corners[face] * weights[:, :, None]).sum(1)
        points, faces = np.concatenate([points, place[keep]]), np.concatenate([faces, face[keep]])
    return points[:count], faces[:count]


def missing(plant, points, share, random):
    """Which of `points` a scan from one side with holes loses (`share` of them), and the direction of the view."""
    azimuth, elevation = random.uniform(0, 2 * np.pi), random.uniform(np.radians(20), np.radians(60))
    view = np.array([np.cos(azimuth) * np.cos(elevation), np.sin(azimuth) * np.cos(elevation), np.sin(elevation)])
    depth = _behind(sample(plant, OCCLUDERS, random)[0], points, view)
    hidden = np.argsort(-depth, kind="stable")[: int(OCCLUDED_SHARE * share * len(points))]
    lost = np.zeros(len(points), bool)
    lost[hidden[depth[hidden] > HIDDEN_BEHIND_M]] = True
    diagonal = np.linalg.norm(np.ptp(points, axis=0))
    while (left := int(share * len(points)) - lost.sum()) > 0:
        centre = points[random.choice(np.flatnonzero(~lost))]
        distance = np.linalg.norm(points - centre, axis=1)
        inside = np.flatnonzero(~lost & (distance < random.uniform(*HOLE_SHARES) * diagonal))
        lost[inside[np.argsort(distance[inside], kind="stable")[:left]]] = True
    return lost, view


def _behind(occluders, points, view):
    """How far each point lies behind the first surface on its line of sight, metres, seen from afar along `view`."""
    right = np.cross([0, 0, 1], view)
    right /= np.linalg.norm(right)
    axes = np.stack([right, np.cross(view, right)], 1)
    corner = np.minimum((occluders @ axes).min(0), (points @ axes).min(0))
    pixel = lambda p: ((p @ axes - corner) / PIXEL_M).astype(int)
    size = np.maximum(pixel(occluders).max(0), pixel(points).max(0)) + 1
    front = np.full(size, -np.inf)
    np.maximum.at(front, tuple(pixel(occluders).T), occluders @ view)
    return front[tuple(pixel(points).T)] - points @ view
