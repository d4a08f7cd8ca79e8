"""The cloud at several coarsenesses that organ3d takes: recon/src/pyramid.rs in NumPy, by the same rule."""

from types import SimpleNamespace

import numpy as np
from scipy.spatial import cKDTree

# As in recon/src/pyramid.rs, where they are explained.
FINEST_SHARE, GROWTH, MOST_CELLS, MOST_ATTENDING, NEIGHBOURS, ABOVE, LEVELS = 0.004, 2**0.25, 4096, 512, 16, 3, 3
LOCAL = 6


def of(points, queries=None, most_cells=MOST_CELLS):
    """Arrays named as the network's inputs; the answer is asked for at `queries` [n,3], without them at `points`."""
    points = np.asarray(points, float)
    low, high = points.min(0), points.max(0)
    diagonal = np.linalg.norm(high - low)
    cell = (diagonal if diagonal > 0 else 1.0) * FINEST_SHARE
    while True:
        keys = ((points - low) * (2 / cell)).astype(np.int64)
        if len(np.unique(packed(keys >> 1))) <= most_cells:
            break
        cell *= GROWTH
    origin = np.array([(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, low[2]])
    levels, parents, below = [], [], (points - origin) / cell
    for level in range(LEVELS + 1):
        keys = keys >> min(level, 1)
        while level == LEVELS and len(np.unique(packed(keys))) > MOST_ATTENDING:
            keys = keys >> 1
        _, first, parent = np.unique(packed(keys), return_index=True, return_inverse=True)
        count = np.bincount(parent)
        below = np.stack([np.bincount(parent, below[:, k]) / count for k in range(3)], 1)
        keys = keys[first]
        levels.append(below)
        parents.append(parent)
    out = SimpleNamespace(points0=levels[0])
    trees = [cKDTree(level) for level in levels]
    for level in range(1, LEVELS + 1):
        setattr(out, f"points{level}", levels[level])
        setattr(out, f"below{level}", nearest(trees[level - 1], levels[level], NEIGHBOURS))
        setattr(out, f"beside{level}", nearest(trees[level], levels[level], NEIGHBOURS))
    out.parent1, out.parent2 = parents[2], parents[3]
    share = cell / diagonal if diagonal > 0 else 0.0
    out.local = np.column_stack([shape_of(levels[0][out.below1]), np.full(len(levels[1]), share)])
    out.points = (np.asarray(points if queries is None else queries, float) - origin) / cell
    out.up = nearest(trees[1], out.points, ABOVE)
    return out


def packed(keys):
    return (keys[:, 0] << 42) | (keys[:, 1] << 21) | keys[:, 2]


def nearest(tree, queries, k):
    """Indices [len(queries), k]; where there are fewer points, the farthest is repeated."""
    found = tree.query(queries, k=list(range(1, min(k, tree.n) + 1)))[1]
    return np.pad(found, ((0, 0), (0, k - found.shape[1])), mode="edge")


def shape_of(groups):
    """Linearity, planarity, scattering, |z| of the normal and |z| of the main axis of each group [n,k,3] (Demantke et
    al. 2011, with eigenvalues in place of their roots)."""
    centred = groups - groups.mean(1, keepdims=True)
    values, vectors = np.linalg.eigh(np.einsum("nki,nkj->nij", centred, centred) / groups.shape[1])
    values = values.clip(0)
    most = np.maximum(values[:, 2], 1e-12)
    columns = [(values[:, 2] - values[:, 1]) / most, (values[:, 1] - values[:, 0]) / most, values[:, 0] / most]
    return np.column_stack([*columns, np.abs(vectors[:, 2, 0]), np.abs(vectors[:, 2, 2])])
