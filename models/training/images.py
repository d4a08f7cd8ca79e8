"""Labelled images as `demeter synth images` writes them, and the randomisation they go through.

A folder holds meta.json and, for n images of h x w pixels, raw row-major arrays: rgb.u8 [n, h, w, 3]; sem.u8 [n, h, w]
(0 background, 1 leaf, 2 stem, 3 main stem); dist.u8 [n, h, w], truncated inverse distance to the nearest pixel of
another organ, times 255; depth.u16 [n, h, w], 0 for none, else 1 + 65534 (ln z - ln 0.05) / (ln 50 - ln 0.05), z in
metres; camera.f32 [n, 3], horizontal field of view, pitch (of the optical axis above the horizon) and roll (by how much
up leans to the right), radians.

A window of a picture is described as a camera that looks along the window's own middle: up is turned into its frame, and
the field of view is the angle between the middles of its left and right edges. So a network that learned from windows
speaks of any photo, cropped or not, as if its principal point were its middle.
"""

import hashlib
import io
import json
import pathlib

import numpy as np
import torch
from PIL import Image, ImageDraw, ImageFilter

# Height and width of what training sees; a batch has one of them. All have about as many pixels.
SHAPES = [(256, 256), (256, 256), (224, 288), (192, 336), (288, 224)]
# delta of dist, pixels: 1 % of the diagonal of a picture of 256 x 256.
DELTA = 0.01 * np.hypot(256, 256)
IGNORED = 255
HELD_OUT = 0.03
LOG_NEAR, LOG_FAR = np.log(0.05), np.log(50.0)
# Name, type of an element, and what follows [n, h, w] in the shape.
FILES = {
    "rgb": ("rgb.u8", "u1", (3,)),
    "sem": ("sem.u8", "u1", ()),
    "dist": ("dist.u8", "u1", ()),
    "depth": ("depth.u16", "<u2", ()),
}
CAMERAS = "camera.f32"
# Ground is what agrees with one horizontal plane: least share of the known background within a part of its depth, and of
# the picture; below it plants stand no higher than this (in logarithms of depth, at their lowest 2 %), or they stand
# elsewhere, on a bench say. All guesses, by eye.
AGREES, AGREEING, BARE, STANDING = 0.06, 0.7, 0.05, 0.15
# A ray that drops by less than this part of its depth meets the ground beyond 25 heights of the camera: no ground.
LEAST_DROP = 0.04
# Part of a window that must show the picture for its camera to be learned from.
MOSTLY = 0.85


class Folder:
    """One folder, mapped, not read. The last 3 % are held out: never trained on."""

    def __init__(self, path):
        self.path = pathlib.Path(path)
        self.meta = json.loads((self.path / "meta.json").read_text())
        n, h, w = (self.meta[key] for key in ("count", "height", "width"))
        for key, (name, kind, tail) in FILES.items():
            shape = (n, h, w, *tail)
            found, expected = (self.path / name).stat().st_size, int(np.prod(shape)) * np.dtype(kind).itemsize
            if found != expected:
                raise SystemExit(f"{self.path / name}: expected {expected} bytes for {shape}, found {found}")
            setattr(self, key, np.memmap(self.path / name, kind, "r", shape=shape))
        self.cameras = np.fromfile(self.path / CAMERAS, "<f4").reshape(n, 3)
        self.learned = n - max(1, int(n * HELD_OUT))
        self.held_out = range(self.learned, n)

    def sha256(self):
        """Over all files, in the order of their names."""
        total = hashlib.sha256()
        for path in sorted(self.path / name for name in ["meta.json", CAMERAS, *(name for name, _, _ in FILES.values())]):
            with path.open("rb") as file:
                while block := file.read(1 << 22):
                    total.update(block)
        return total.hexdigest()

    def image(self, i):
        """Image i as (rgb, sem, dist 0..1 by DELTA, log depth or 0, where depth is known, log depth of the ground beneath
        or NaN), all [h, w] but rgb [h, w, 3] u8, and its camera (ln tan(hfov / 2), up in the camera's frame, 1 for known)
        [5]."""
        known = self.depth[i] > 0
        log_depth = LOG_NEAR + (self.depth[i].astype(np.float32) - 1) / 65534 * (LOG_FAR - LOG_NEAR)
        log_depth = np.where(known, log_depth, 0).astype(np.float32)
        # The label is delta / max(d, delta). Where it is 1, d is unknown: it stays 1.
        dist = self.dist[i].astype(np.float32) / 255
        dist = np.where(dist >= 1, 1, np.minimum(1, dist * DELTA / (0.01 * np.hypot(*dist.shape))))
        hfov, pitch, roll = self.cameras[i].astype(np.float64)
        up = np.cos(pitch) * np.sin(roll), -np.cos(pitch) * np.cos(roll), np.sin(pitch)
        camera = np.array([np.log(np.tan(hfov / 2)), *up, 1])
        sem = np.array(self.sem[i])
        return np.array(self.rgb[i]), sem, dist, log_depth, known, ground_beneath(sem, log_depth, known, camera), camera


def ground_beneath(sem, log_depth, known, camera):
    """Log depth of the horizontal plane that the plants stand on, behind every pixel that looks down on it; NaN elsewhere,
    and everywhere when the background is something else, a wall say."""
    height, width = sem.shape
    nothing = np.full(sem.shape, np.nan, np.float32)
    right, down = (2 * np.arange(width) + 1 - width) / width, (2 * np.arange(height) + 1 - height) / width
    # By how much the ray to a pixel drops on its way to a depth of 1.
    drop = -(np.exp(camera[0]) * (camera[1] * right[None] + camera[2] * down[:, None]) + camera[3])
    log_drop = np.log(drop, where=drop > LEAST_DROP, out=nothing.copy())
    # The camera's height above what is seen there.
    heights = log_depth + log_drop
    bare = known & (sem == 0) & np.isfinite(log_drop)
    if bare.mean() < BARE:
        return nothing
    level = np.median(heights[bare])
    if (np.abs(heights[bare] - level) < AGREES).sum() < AGREEING * (known & (sem == 0)).sum():
        return nothing
    relief = (level - heights)[known & (sem > 0) & np.isfinite(log_drop)]
    if relief.size > 0 and np.quantile(relief, 0.02) > STANDING:
        return nothing
    return (level - log_drop).astype(np.float32)


def tensors(rgb, sem, dist, log_depth, known, ground, camera):
    """One sample as the tensors that training takes: image in 0..1 [3, h, w] and its labels."""
    image = torch.from_numpy(np.ascontiguousarray(rgb.transpose(2, 0, 1), np.float32))
    labels = (sem.astype(np.int64), *(label.astype(np.float32) for label in (dist, log_depth, known, ground, camera)))
    return (image, *(torch.from_numpy(np.ascontiguousarray(label)) for label in labels))


class Randomised(torch.utils.data.Dataset):
    """Sample i is an image changed by a generator seeded with (seed, i): the same in every run. `batch` samples in turn
    have the same shape."""

    def __init__(self, folders, seed, first, count, batch):
        self.folders, self.seed, self.first, self.count, self.batch = folders, seed, first, count, batch

    def __len__(self):
        return self.count

    def __getitem__(self, i):
        random = np.random.default_rng((self.seed, self.first + i))
        at = random.integers(sum(folder.learned for folder in self.folders))
        for folder in self.folders:
            if at < folder.learned:
                break
            at -= folder.learned
        return tensors(*randomised(random, shape_of(self.seed, (self.first + i) // self.batch), *folder.image(at)))


def shape_of(seed, batch):
    """Height and width of a batch."""
    return SHAPES[np.random.default_rng((seed, 1 << 40, batch)).integers(len(SHAPES))]


def randomised(random, shape, *labelled):
    """A crop at another scale, maybe mirrored, under another light, through a worse camera."""
    *arrays, camera = cropped(random, shape, *labelled)
    if random.random() < 0.5:
        arrays = [array[:, ::-1] for array in arrays]
        camera = camera * [1, -1, 1, 1, 1]
    rgb, sem, dist, log_depth, known, ground = arrays
    rgb = rgb.astype(np.float32) / 255
    organ = ((sem > 0) & (sem != IGNORED)).astype(np.float32)
    if random.random() < 0.4:
        rgb, hidden = other_background(random, rgb, softened(organ, random.uniform(0.3, 0.8)))
        if hidden:
            known, ground = known & (organ > 0), np.full_like(ground, np.nan)
    if random.random() < 0.6:
        soft = softened(organ, 0.5)
        rgb = rgb + soft * (recoloured(random, rgb, hue=0.35, saturation=0.4, gain=0.35) - rgb)
    return through_lens(random, lit(random, rgb)), sem, dist, log_depth, known, ground, camera


def cropped(random, shape, rgb, sem, dist, log_depth, known, ground, camera):
    """A window brought to `shape`, 0.7 to 1.5 times as large, no side more than 1.2 times the picture's; what lies outside
    the picture is a mirror image whose labels are ignored."""
    least = max(0.7, *(part / (1.2 * whole) for part, whole in zip(shape, sem.shape)))
    scale = np.exp(random.uniform(np.log(least), np.log(max(1.5, least))))
    tall, wide = (int(round(side / scale)) for side in shape)
    height, width = sem.shape
    top, left = (whole - part for whole, part in ((height, tall), (width, wide)))
    y, x = (int(random.integers(min(0, room) // 2, max(0, room) - (-min(0, room) // 2) + 1)) for room in (top, left))
    camera = window_camera(camera, (height, width), (y, x), (tall, wide))
    inside = min(height, y + tall) - max(0, y), min(width, x + wide) - max(0, x)
    camera[4] = np.prod(inside) > MOSTLY * tall * wide
    pad = [(max(0, -at), max(0, at + part - whole)) for at, part, whole in ((y, tall, height), (x, wide, width))]
    if max(max(edges) for edges in pad) > 0:
        rgb = np.pad(rgb, [*pad, (0, 0)], mode="reflect")
        sem = np.pad(sem, pad, constant_values=IGNORED)
        dist, log_depth, known, ground = (np.pad(array, pad) for array in (dist, log_depth, known, ground))
    y, x = max(0, y), max(0, x)
    rgb = np.asarray(Image.fromarray(rgb[y : y + tall, x : x + wide]).resize(shape[::-1], Image.BILINEAR))
    rows, columns = (
        at + np.clip(((np.arange(to) + 0.5) * part / to).astype(int), 0, part - 1)
        for at, part, to in ((y, tall, shape[0]), (x, wide, shape[1]))
    )
    maps = sem, dist, log_depth, known, ground
    sem, dist, log_depth, known, ground = (array[np.ix_(rows, columns)] for array in maps)
    # Distances grow with the scale.
    dist = np.where(dist >= 1, 1, np.minimum(1, dist / scale))
    return rgb, sem, dist, log_depth, known, ground, camera


def window_camera(camera, whole, corner, part):
    """The camera of a window: see above. Sizes and places are (down, right), pixels."""
    focal = 0.5 * whole[1] / np.exp(camera[0])
    down, right = ((at + 0.5 * size - 0.5 * full) / focal for at, size, full in zip(corner, part, whole))
    half = 0.5 * part[1] / focal
    edges = [np.array([right + side * half, down, 1]) for side in (-1, 1)]
    edges = [edge / np.linalg.norm(edge) for edge in edges]
    axis = np.array([right, down, 1]) / np.sqrt(right**2 + down**2 + 1)
    # The least rotation that takes the axis to (0, 0, 1).
    between = axis + [0, 0, 1]
    up = camera[1:4]
    up = up - between * (between @ up) / (1 + axis[2]) + 2 * np.array([0, 0, 1]) * (axis @ up)
    return np.array([np.log(np.tan(0.5 * np.arccos(np.clip(edges[0] @ edges[1], -1, 1)))), *up, camera[4]])


def softened(mask, radius):
    image = Image.fromarray((mask * 255).astype(np.uint8)).filter(ImageFilter.GaussianBlur(radius))
    return (np.asarray(image, np.float32) / 255)[..., None]


def smooth(random, shape, cells, channels):
    """A random smooth field in 0..1, [*shape, channels], with about `cells` cells a side."""
    grid = (random.random((cells, cells, channels)) * 255).astype(np.uint8)
    planes = [Image.fromarray(grid[..., c]).resize(shape[::-1], Image.BICUBIC) for c in range(channels)]
    return np.stack([np.asarray(plane, np.float32) / 255 for plane in planes], axis=-1)


def other_background(random, rgb, organ):
    """Another ground behind the plant: recoloured at will, one plain colour, or a texture; and whether the old one's
    shape is gone."""
    kind, shape = random.integers(3), rgb.shape[:2]
    if kind == 0:
        other = recoloured(random, rgb, hue=np.pi, saturation=0.9, gain=0.6)
    elif kind == 1:
        # Walls, cloths and cabinets are light and grey more often than not.
        grey = random.uniform(0.1, 1.0) * np.ones(3)
        colour = np.clip(grey + random.normal(0, 0.12, 3), 0, 1) if random.random() < 0.6 else random.random(3)
        other = colour * (1 + random.uniform(0, 0.4) * (smooth(random, shape, 3, 1) - 0.5))
    else:
        colour = smooth(random, shape, int(random.integers(3, 48)), 3) - 0.5
        grey = smooth(random, shape, int(random.integers(3, 64)), 1) - 0.5
        other = random.random(3) + random.uniform(0, 0.6) * colour + random.uniform(0, 0.9) * grey
    if random.random() < 0.4:
        other = with_things(random, other)
    alpha = (1 - organ) * (random.uniform(0.5, 1) if random.random() < 0.5 else 1.0)
    return (rgb + alpha * (other - rgb)).astype(np.float32), kind > 0


def with_things(random, rgb):
    """Pots, stakes, cables, stones, dark frames of photos: a few plain shapes that are no plant."""
    height, width = rgb.shape[:2]
    image = Image.fromarray((np.clip(rgb, 0, 1) * 255).astype(np.uint8))
    draw = ImageDraw.Draw(image)
    for _ in range(random.integers(1, 6)):
        x, other_x = (float(value) for value in random.uniform(-30, width + 30, 2))
        y, other_y = (float(value) for value in random.uniform(-30, height + 30, 2))
        grey = random.uniform(0, 255) * np.ones(3)
        colour = tuple(int(value) for value in np.clip(random.normal(grey, 25), 0, 255))
        box = [min(x, other_x), min(y, other_y), max(x, other_x), max(y, other_y)]
        kind = random.integers(4)
        if kind == 0:
            draw.rectangle(box, fill=colour)
        elif kind == 1:
            draw.ellipse(box, fill=colour)
        elif kind == 2:
            upright = random.random() < 0.7
            edge = random.choice([0, width if upright else height])
            near, far = sorted(int(at) for at in edge + random.integers(-12, 12, 2))
            draw.rectangle([near, 0, far, height] if upright else [0, near, width, far], fill=colour)
        else:
            draw.line([x, y, other_x, other_y], fill=colour, width=int(random.integers(1, 12)))
    return np.asarray(image, np.float32) / 255


def recoloured(random, rgb, hue, saturation, gain):
    """Hue turned by up to `hue` radians about the grey axis, saturation and brightness changed by up to these parts."""
    angle = random.uniform(-hue, hue)
    grey = rgb.mean(axis=-1, keepdims=True)
    colour = (rgb - grey) * (1 + random.uniform(-saturation, saturation))
    # Rodrigues' rotation about (1, 1, 1) / sqrt(3); colour is already perpendicular to it.
    across = (np.roll(colour, 1, -1) - np.roll(colour, -1, -1)) / np.sqrt(3)
    return (grey + colour * np.cos(angle) + across * np.sin(angle)) * (1 + random.uniform(-gain, gain))


def lit(random, rgb):
    """Exposure, contrast, gamma, white balance, uneven light, and sometimes no colour at all."""
    if random.random() < 0.3:
        rgb = rgb * (1 + random.uniform(0.2, 1.2) * (smooth(random, rgb.shape[:2], int(random.integers(2, 7)), 1) - 0.5))
    rgb = rgb * np.exp(random.normal(0, 0.08, 3)) * np.exp(random.normal(0, 0.25))
    rgb = (rgb - 0.5) * random.uniform(0.7, 1.35) + 0.5 + random.normal(0, 0.04)
    rgb = np.clip(rgb.astype(np.float32), 0, 1) ** np.float32(np.exp(random.normal(0, 0.25)))
    if random.random() < 0.05:
        rgb = np.repeat(rgb.mean(axis=-1, keepdims=True), 3, axis=-1)
    return rgb


def through_lens(random, rgb):
    """Blur, noise and JPEG; the result is in 0..1."""
    image = Image.fromarray((np.clip(rgb, 0, 1) * 255).astype(np.uint8))
    if random.random() < 0.3:
        image = image.filter(ImageFilter.GaussianBlur(random.uniform(0.3, 1.6)))
    if random.random() < 0.5:
        noisy = np.asarray(image, np.float32) + random.normal(0, random.uniform(1, 14), rgb.shape)
        image = Image.fromarray(np.clip(noisy, 0, 255).astype(np.uint8))
    if random.random() < 0.4:
        data = io.BytesIO()
        image.save(data, "JPEG", quality=int(random.integers(25, 92)))
        image = Image.open(data).convert("RGB")
    return np.asarray(image, np.float32) / 255
