#!/usr/bin/python3
"""Paints what a checkpoint of organ2d or relief2d sees in photos: photo, classes, boundaries and depth side by side, with the camera in words, to look at.

Where plants stand before a light wall, a threshold on colour gives a mask to compare with (`--before-light`): its
figure is a sanity check on real photos, not truth, and never training data.
"""

import argparse
import pathlib

import numpy as np
import torch
from PIL import Image, ImageDraw

from network import Organ2d, Relief2d

COLOURS = np.array([[0, 0, 0], [70, 200, 70], [240, 170, 40], [230, 40, 40]], np.uint8)
LONG_SIDE = 384


def working_image(path):
    """As models/src/organ2d.rs does it: long side 384, sides multiples of 16."""
    image = Image.open(path).convert("RGB")
    scale = LONG_SIDE / max(image.size)
    return image.resize([max(1, round(side * scale / 16)) * 16 for side in image.size], Image.BILINEAR)


def green_or_dark(rgb):
    """Excess green (Woebbecke et al. 1995) of chromatic coordinates above 0.06, or no channel above 0.55: what a plant
    is before a light wall. Both tuned by eye."""
    share = rgb / np.maximum(rgb.sum(-1, keepdims=True), 1)
    return (2 * share[..., 1] - share[..., 0] - share[..., 2] > 0.06) | (rgb.max(-1) < 0.55 * 255)


def grey(depth):
    """Log depth as brightness, near is bright; the nearest and farthest 2 % are cut."""
    near, far = np.percentile(depth, [2, 98])
    return (255 - 235 * ((depth - near) / max(far - near, 1e-6)).clip(0, 1)).astype(np.uint8)


def words(camera):
    """Field of view, pitch and roll, degrees, with what the network expects to err by."""
    hfov = 2 * np.arctan(np.exp(camera[0]))
    pitch, roll = np.arcsin(camera[3].clip(-1, 1)), np.arctan2(camera[1], -camera[2])
    spread = np.exp(camera[4:])
    hfov, pitch, roll, off = np.degrees([hfov, pitch, roll, spread[1]])
    return f"hfov {hfov:.0f} +- {100 * spread[0]:.0f} %, pitch {pitch:.0f}, roll {roll:.0f} +- {off:.0f}"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("network", choices=["organ2d", "relief2d"])
    parser.add_argument("checkpoint", type=pathlib.Path)
    parser.add_argument("images", nargs="+", type=pathlib.Path)
    parser.add_argument("-o", "--out", type=pathlib.Path)
    parser.add_argument("--before-light", action="store_true", help="compare with what is green or dark above the pot")
    args = parser.parse_args()
    torch.set_num_threads(1)
    network = {"organ2d": Organ2d, "relief2d": Relief2d}[args.network]().eval()
    network.load_state_dict(torch.load(args.checkpoint)["average"])
    rows, overlaps = [], []
    for path in args.images:
        rgb = np.asarray(working_image(path))
        with torch.no_grad():
            image = torch.from_numpy(rgb.transpose(2, 0, 1).astype(np.float32) / 255)[None]
            logits, dist, depth, camera = (output[0].numpy() for output in network(image))
        best = logits.argmax(0)
        if args.before_light:
            # Without the pot below and the dark frame that some photos have at their sides.
            above = slice(0, rgb.shape[0] * 15 // 16), slice(6, -6)
            plant, mask = best[above] > 0, green_or_dark(rgb.astype(np.float32))[above]
            overlaps.append((plant & mask).sum() / max(1, (plant | mask).sum()))
        if args.out:
            maps = np.stack([(dist[0] * 255 * (best > 0)).astype(np.uint8), grey(depth[0])])[..., None].repeat(3, -1)
            row = Image.fromarray(np.concatenate([rgb, COLOURS[best], *maps], axis=1))
            row = row.resize((1200, max(1, row.height * 1200 // row.width)))
            ImageDraw.Draw(row).text((4, 2), f"{path.name[:24]}: {words(camera)}", fill=(255, 255, 0), stroke_width=1, stroke_fill=(0, 0, 0))
            rows.append(row)
    if overlaps:
        figures = f"mean {np.mean(overlaps):.3f}, median {np.median(overlaps):.3f}, worst {min(overlaps):.3f}"
        print(f"IoU with the colour threshold: {figures}, {len(overlaps)} photos")
    if args.out:
        sheet = Image.new("RGB", (1200, sum(row.height for row in rows)))
        top = 0
        for row in rows:
            sheet.paste(row, (0, top))
            top += row.height
        sheet.save(args.out)


if __name__ == "__main__":
    main()
