"""One pyhelios3d plant as triangles with their organs, and the organs with their measured truth.

Lengths are metres, angles radians, z is up, the plant stands at the origin.
"""

from dataclasses import dataclass, field
from functools import lru_cache
from math import pi

import numpy as np
from PIL import Image
from pyhelios import Context, PlantArchitecture
from pyhelios.types import vec3

# What the generator calls the species that we call otherwise.
MODEL = {"pepper": "capsicum"}
# A petiole or shoot shorter than this is no organ of its own: its points and children are its parent's. The grasses of
# the generator have petioles of 0.1 mm, its buds shoots of less than one.
SHORTEST_STEM_M = 0.005
# The generator counts a texel solid above this alpha; its leaf areas come out equal to a part in a thousand.
SOLID_ALPHA = 250
# Steps along the midrib at which its length is measured.
MIDRIB_STEPS = 200

# The generator's number for a tube among its kinds of objects.
TUBE = 2

MAIN_STEM, STEM, BLADE = 0, 1, 2


@dataclass
class Organ:
    """One node of the plant's tree. `parent` is -1 for the main stem; `attach` is the arc length on the parent."""

    id: int
    kind: int
    role: str
    parent: int
    label: int = 0
    leaf: int = -1
    attach: float = 0.0
    axis: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))
    radius: float = 0.0
    area: float = 0.0
    inclination: float = 0.0

    @property
    def length(self):
        return float(np.linalg.norm(np.diff(self.axis, axis=0), axis=1).sum())


@dataclass
class Plant:
    """Triangles [T,3,3], their texture coordinates [T,3,2], texture (empty: none), solid area in m2 and organ."""

    corners: np.ndarray
    uv: np.ndarray
    texture: np.ndarray
    area: np.ndarray
    organ: np.ndarray
    organs: list
    nodes: list


@lru_cache(maxsize=None)
def solid_texels(path):
    """Opaque texels of a leaf's picture, rows from v = 0 upwards."""
    return np.asarray(Image.open(path).convert("RGBA"))[::-1, :, 3] > SOLID_ALPHA


def is_solid(path, uv):
    """Whether the texture is opaque at each of `uv` [N,2]."""
    texels = solid_texels(path)
    size = np.array(texels.shape[::-1])
    column, row = np.clip((uv * size).astype(int), 0, size - 1).T
    return texels[row, column]


def grow(species, seed, age_days):
    """The plant of this species, seed and age."""
    with Context() as context:
        context.seedRandomGenerator(seed)
        with PlantArchitecture(context) as architecture:
            architecture.disableMessages()
            architecture.loadPlantModelFromLibrary(MODEL.get(species, species))
            plant = architecture.buildPlantInstanceFromLibrary(vec3(0, 0, 0), age_days)
            return _read(context, architecture, plant)


def _points(vectors):
    return np.array([tuple(v) if isinstance(v, tuple) else (v.x, v.y, v.z) for v in vectors])


def _read(context, architecture, plant):
    organs, of_object, nodes = _tree(context, architecture, plant)
    triangles = []
    for thing, organ in of_object.items():
        primitives = context.getObjectPrimitiveUUIDs(thing)
        labels = [context.getPrimitiveData(p, "object_label") for p in primitives]
        leaf = np.array([label == "leaf" for label in labels])
        corners = context.getPrimitiveVertices(primitives)[0].reshape(-1, 3, 3).astype(float)
        flat, offsets = context.getPrimitiveTextureUV(primitives)
        uv = np.zeros((len(primitives), 3, 2))
        textures = np.array(context.getPrimitiveTextureFile(primitives))
        for k in np.flatnonzero(textures != ""):
            uv[k] = flat[offsets[k] : offsets[k] + 6].reshape(3, 2)
        area = context.getPrimitiveArea(primitives).astype(float)
        # A petiolule belongs to the generator's leaf object; it is a centimetre at most and counts as petiole here.
        stem = organ.parent if organ.kind == BLADE else organ.id
        triangles.append((corners, uv, textures, area, np.where(leaf, organ.id, stem)))
    parts = [np.concatenate(part) for part in zip(*triangles)]
    whole = Plant(*parts, organs=organs, nodes=nodes)
    for organ in organs:
        if organ.kind == BLADE:
            _measure_blade(organ, whole)
    _attach(organs)
    return whole


def _tree(context, architecture, plant):
    """Organs with parents, the organ of each object, and the arc lengths of the main stem's nodes."""
    shoots = {s: architecture.getShoot(plant, s) for s in architecture.getAllShootIDs(plant)}
    line = {s: _points(architecture.getShootInternodeVertices(plant, s)) for s in shoots}
    tubes = [o for o in architecture.getAllPlantObjectIDs(plant) if context.getObjectType(o) == TUBE]
    tubes = {o: _points(context.getTubeObjectNodes(o)) for o in tubes}

    def tube_of(axis):
        return min(tubes, key=lambda o: np.linalg.norm(tubes[o].mean(0) - axis.mean(0)))

    # The main stem is the chain of shoots of rank 0, each continuing the one before it.
    chain = [next(s for s, shoot in shoots.items() if shoot["parent_shoot_id"] < 0)]
    while follow := [s for s, shoot in shoots.items() if shoot["parent_shoot_id"] == chain[-1] and shoot["rank"] == 0]:
        chain.append(follow[0])
    main = Organ(0, MAIN_STEM, "main_stem", -1, axis=np.concatenate([line[s] for s in chain]))
    organs, of_object, nodes = [main], {}, []
    of_shoot = {s: main for s in chain}
    radii = [r for s in chain for r in architecture.getShootInternodeRadii(plant, s)]
    main.radius = float(np.mean(radii))

    def add(kind, role, parent, axis, radius):
        if len(axis) < 2 or np.linalg.norm(np.diff(axis, axis=0), axis=1).sum() < SHORTEST_STEM_M:
            return parent
        organs.append(Organ(len(organs), kind, role, parent.id, axis=axis, radius=float(np.mean(radius))))
        return organs[-1]

    for s in sorted(shoots, key=lambda s: architecture.getShootDepth(plant, s)):
        if s not in of_shoot:
            radius = architecture.getShootInternodeRadii(plant, s)
            of_shoot[s] = add(STEM, "branch", of_shoot[shoots[s]["parent_shoot_id"]], line[s], radius)
        if len(line[s]):
            of_object[tube_of(line[s])] = of_shoot[s]
    height, leaf = 0.0, 0
    for s in sorted(shoots):
        for node in range(shoots[s]["node_count"]):
            if s in chain:
                height += architecture.getInternodeLength(plant, s, node)
                nodes.append(height)
            for k, blades in enumerate(architecture.getPhytomerLeafObjectIDs(plant, s, node)):
                axis = _points(architecture.getPetioleVertices(plant, s, node, k))
                radius = architecture.getPetioleRadii(plant, s, node, k)
                carrier = add(STEM, "petiole", of_shoot[s], axis, radius)
                of_object[tube_of(axis)] = carrier
                for blade in blades:
                    organs.append(Organ(len(organs), BLADE, "blade", carrier.id, leaf=leaf))
                    of_object[blade] = organs[-1]
                leaf += 1
    for label, organ in enumerate([o for o in organs if o.kind == BLADE], 1):
        organ.label = label
    return organs, of_object, nodes


def _measure_blade(organ, plant):
    """Area, inclination and midrib of a blade from its solid surface.

    The inclination is the angle of the area-weighted mean normal to the vertical, folded into 0..pi/2, as
    recon/src/traits/blade.rs has it. The midrib is the picture's straight line from the middle of its first column
    with solid texels to that of its last one, laid on the surface: the pictures show the midrib there, a few degrees
    off the middle line v = 1/2, which leaves some blades up to 6 % before their tip. Pictures that show a stub of the
    petiole begin with it, and so do the blade's points.
    """
    own = plant.organ == organ.id
    corners, uv, area = plant.corners[own], plant.uv[own], plant.area[own]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    size = np.linalg.norm(normal, axis=1, keepdims=True)
    mean = (normal / np.where(size > 0, size, 1) * area[:, None]).sum(0)
    tilt = np.arccos(np.clip(mean[2] / max(np.linalg.norm(mean), 1e-300), -1, 1))
    organ.area, organ.inclination = float(area.sum()), float(min(tilt, pi - tilt))
    base, tip = _ends(plant.texture[own][0])
    along = np.linspace(0, 1, MIDRIB_STEPS + 1)[:, None]
    organ.axis = np.array([_on_surface(q, uv, corners) for q in base + along * (tip - base)])


@lru_cache(maxsize=None)
def _ends(path):
    """Texture coordinates of a blade's base and tip: the middles of the first and last column with solid texels."""
    texels = solid_texels(path)
    columns = np.flatnonzero(texels.any(0))
    size = np.array(texels.shape[::-1])
    return [np.array([c + 0.5, np.flatnonzero(texels[:, c]).mean() + 0.5]) / size for c in columns[[0, -1]]]


def _on_surface(q, uv, corners):
    """The surface's point at texture coordinates `q`: of the triangle that holds them, or nearly does."""
    a, b, c = uv[:, 0], uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    det = b[:, 0] * c[:, 1] - b[:, 1] * c[:, 0]
    det = np.where(np.abs(det) > 1e-12, det, np.nan)
    d = q - a
    s = (d[:, 0] * c[:, 1] - d[:, 1] * c[:, 0]) / det
    t = (b[:, 0] * d[:, 1] - b[:, 1] * d[:, 0]) / det
    k = int(np.nanargmax(np.minimum(np.minimum(s, t), 1 - s - t)))
    return corners[k, 0] * (1 - s[k] - t[k]) + corners[k, 1] * s[k] + corners[k, 2] * t[k]


def _attach(organs):
    """Arc length on the parent's axis nearest to each organ's base."""
    for organ in organs[1:]:
        axis, base = organs[organ.parent].axis, organ.axis[0]
        step = np.diff(axis, axis=0)
        length = np.linalg.norm(step, axis=1)
        share = np.clip(((base - axis[:-1]) * step).sum(1) / np.maximum(length**2, 1e-18), 0, 1)
        gap = np.linalg.norm(axis[:-1] + share[:, None] * step - base, axis=1)
        k = int(gap.argmin())
        organ.attach = float(length[:k].sum() + share[k] * length[k])
