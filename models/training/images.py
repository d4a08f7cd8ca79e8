"""Labelled images as `demeter synth images` writes them, and the randomisation they go through.

A folder holds meta.json and, for n images of h x w pixels, raw row-major arrays: rgb.u8 [n, h, w, 3]; sem.u8 [n, h, w]
(0 background, 1 leaf, 2 stem, 3 main stem); dist.u8 [n, h, w], truncated inverse distance to the nearest pixel of
another organ, times 255; depth.u16 [n, h, w], 0 for none, else 1 + 65534 (ln z - ln 0.05) / (ln 50 - ln 0.05), z in
metres.
"""

import hashlib
import io
import json
import pathlib

import numpy as np
import torch
from PIL import Image, ImageDraw, ImageFilter

SIDE = 256
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
        self.learned = n - max(1, int(n * HELD_OUT))
        self.held_out = range(self.learned, n)

    def sha256(self):
        """Over all files, in the order of their names."""
        total = hashlib.sha256()
        for path in sorted(self.path / name for name in ["meta.json", *(name for name, _, _ in FILES.values())]):
            with path.open("rb") as file:
                while block := file.read(1 << 22):
                    total.update(block)
        return total.hexdigest()

    def image(self, i):
        """Image i as (rgb, sem, dist 0..1, log depth or 0, where depth is known), all [h, w] but rgb [h, w, 3] u8."""
        known = self.depth[i] > 0
        log_depth = LOG_NEAR + (self.depth[i].astype(np.float32) - 1) / 65534 * (LOG_FAR - LOG_NEAR)
        log_depth = np.where(known, log_depth, 0).astype(np.float32)
        return np.array(self.rgb[i]), np.array(self.sem[i]), self.dist[i].astype(np.float32) / 255, log_depth, known


def tensors(rgb, sem, dist, log_depth, known):
    """One sample as the tensors that training takes: image in 0..1 [3, h, w] and its labels."""
    image = torch.from_numpy(np.ascontiguousarray(rgb.transpose(2, 0, 1), np.float32))
    labels = (sem.astype(np.int64), dist.astype(np.float32), log_depth.astype(np.float32), known.astype(np.float32))
    return (image, *(torch.from_numpy(np.ascontiguousarray(label)) for label in labels))


class Randomised(torch.utils.data.Dataset):
    """Sample i is image `order[i]` changed by a generator seeded with (seed, i): the same in every run."""

    def __init__(self, folders, seed, first, count):
        self.folders, self.seed, self.first, self.count = folders, seed, first, count

    def __len__(self):
        return self.count

    def __getitem__(self, i):
        random = np.random.default_rng((self.seed, self.first + i))
        at = random.integers(sum(folder.learned for folder in self.folders))
        for folder in self.folders:
            if at < folder.learned:
                break
            at -= folder.learned
        return tensors(*randomised(random, *folder.image(at)))


def randomised(random, rgb, sem, dist, log_depth, known):
    """A crop at another scale, maybe mirrored, under another light, through a worse camera."""
    rgb, sem, dist, log_depth, known = cropped(random, rgb, sem, dist, log_depth, known)
    if random.random() < 0.5:
        rgb, sem, dist, log_depth, known = (array[:, ::-1] for array in (rgb, sem, dist, log_depth, known))
    rgb = rgb.astype(np.float32) / 255
    organ = ((sem > 0) & (sem != IGNORED)).astype(np.float32)
    if random.random() < 0.6:
        rgb = other_background(random, rgb, softened(organ, random.uniform(0.3, 0.8)))
    if random.random() < 0.6:
        soft = softened(organ, 0.5)
        rgb = rgb + soft * (recoloured(random, rgb, hue=0.35, saturation=0.4, gain=0.35) - rgb)
    return camera(random, lit(random, rgb)), sem, dist, log_depth, known


def cropped(random, rgb, sem, dist, log_depth, known):
    """A square window brought to SIDE pixels, 0.7 to 1.5 times as large; what lies outside the picture is a mirror
    image whose labels are ignored."""
    scale = np.exp(random.uniform(np.log(0.7), np.log(1.5)))
    side = int(round(SIDE / scale))
    height, width = sem.shape
    if side > min(height, width):
        pad = [(max(0, side - height),) * 2, (max(0, side - width),) * 2]
        rgb = np.pad(rgb, [*pad, (0, 0)], mode="reflect")
        sem = np.pad(sem, pad, constant_values=IGNORED)
        dist, log_depth, known = (np.pad(array, pad) for array in (dist, log_depth, known))
        height, width = sem.shape
    y, x = random.integers(height - side + 1), random.integers(width - side + 1)
    rgb = np.asarray(Image.fromarray(rgb[y : y + side, x : x + side]).resize((SIDE, SIDE), Image.BILINEAR))
    pick = np.clip(((np.arange(SIDE) + 0.5) * side / SIDE).astype(int), 0, side - 1)
    sem, dist, log_depth, known = (array[np.ix_(y + pick, x + pick)] for array in (sem, dist, log_depth, known))
    # The label is d0 / max(d, d0) with a fixed d0 in pixels (1 % of the diagonal), and distances grow with the scale.
    # Where it is 1, d is unknown: it stays 1.
    dist = np.where(dist >= 1, 1, np.minimum(1, dist / scale))
    return rgb, sem, dist, log_depth, known


def softened(mask, radius):
    image = Image.fromarray((mask * 255).astype(np.uint8)).filter(ImageFilter.GaussianBlur(radius))
    return (np.asarray(image, np.float32) / 255)[..., None]


def smooth(random, cells, channels):
    """A random smooth field in 0..1, [SIDE, SIDE, channels], with about `cells` cells a side."""
    grid = (random.random((cells, cells, channels)) * 255).astype(np.uint8)
    planes = [Image.fromarray(grid[..., c]).resize((SIDE, SIDE), Image.BICUBIC) for c in range(channels)]
    return np.stack([np.asarray(plane, np.float32) / 255 for plane in planes], axis=-1)


def other_background(random, rgb, organ):
    """Another ground behind the plant: recoloured at will, one plain colour, or a texture."""
    kind = random.integers(3)
    if kind == 0:
        other = recoloured(random, rgb, hue=np.pi, saturation=0.9, gain=0.6)
    elif kind == 1:
        # Walls, cloths and cabinets are light and grey more often than not.
        grey = random.uniform(0.1, 1.0) * np.ones(3)
        colour = np.clip(grey + random.normal(0, 0.12, 3), 0, 1) if random.random() < 0.6 else random.random(3)
        other = colour * (1 + random.uniform(0, 0.4) * (smooth(random, 3, 1) - 0.5))
    else:
        colour = smooth(random, int(random.integers(3, 48)), 3) - 0.5
        grey = smooth(random, int(random.integers(3, 64)), 1) - 0.5
        other = random.random(3) + random.uniform(0, 0.6) * colour + random.uniform(0, 0.9) * grey
    if random.random() < 0.4:
        other = with_things(random, other)
    alpha = (1 - organ) * (random.uniform(0.5, 1) if random.random() < 0.5 else 1.0)
    return (rgb + alpha * (other - rgb)).astype(np.float32)


def with_things(random, rgb):
    """Pots, stakes, cables, stones, dark frames of photos: a few plain shapes that are no plant."""
    image = Image.fromarray((np.clip(rgb, 0, 1) * 255).astype(np.uint8))
    draw = ImageDraw.Draw(image)
    for _ in range(random.integers(1, 6)):
        x, y, other_x, other_y = (float(value) for value in random.uniform(-30, SIDE + 30, 4))
        grey = random.uniform(0, 255) * np.ones(3)
        colour = tuple(int(value) for value in np.clip(random.normal(grey, 25), 0, 255))
        box = [min(x, other_x), min(y, other_y), max(x, other_x), max(y, other_y)]
        kind = random.integers(4)
        if kind == 0:
            draw.rectangle(box, fill=colour)
        elif kind == 1:
            draw.ellipse(box, fill=colour)
        elif kind == 2:
            near, far = sorted(int(edge) for edge in random.choice([0, SIDE]) + random.integers(-12, 12, 2))
            draw.rectangle([near, 0, far, SIDE] if random.random() < 0.7 else [0, near, SIDE, far], fill=colour)
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
        rgb = rgb * (1 + random.uniform(0.2, 1.2) * (smooth(random, int(random.integers(2, 7)), 1) - 0.5))
    rgb = rgb * np.exp(random.normal(0, 0.08, 3)) * np.exp(random.normal(0, 0.25))
    rgb = (rgb - 0.5) * random.uniform(0.7, 1.35) + 0.5 + random.normal(0, 0.04)
    rgb = np.clip(rgb, 0, 1) ** np.exp(random.normal(0, 0.25))
    if random.random() < 0.05:
        rgb = np.repeat(rgb.mean(axis=-1, keepdims=True), 3, axis=-1)
    return rgb


def camera(random, rgb):
    """Blur, noise and JPEG; the result is in 0..1."""
    image = Image.fromarray((np.clip(rgb, 0, 1) * 255).astype(np.uint8))
    if random.random() < 0.3:
        image = image.filter(ImageFilter.GaussianBlur(random.uniform(0.3, 1.6)))
    if random.random() < 0.5:
        noisy = np.asarray(image, np.float32) + random.normal(0, random.uniform(1, 14), (SIDE, SIDE, 3))
        image = Image.fromarray(np.clip(noisy, 0, 255).astype(np.uint8))
    if random.random() < 0.4:
        data = io.BytesIO()
        image.save(data, "JPEG", quality=int(random.integers(25, 92)))
        image = Image.open(data).convert("RGB")
    return np.asarray(image, np.float32) / 255
