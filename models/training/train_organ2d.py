#!/usr/bin/python3
"""Trains organ2d: see README.md beside this file."""

import os

# One thread: PyTorch's own threads wait actively and take the machine from everyone else.
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")

import numpy as np
import torch

import export2d
from images import IGNORED, LOG_FAR, LOG_NEAR, SHAPES, Folder, Randomised, tensors
from losses import Figures, camera_loss, depth_loss, dist_loss, semantic_loss
from network import CLASSES, Organ2d
from run import Run, arguments, command

BATCH = 8
LEARNING_RATE = 2e-3
# Plants in a picture with fewer pixels say little of their relief.
MIN_PIXELS = 200


class Noise(torch.utils.data.Dataset):
    """Samples of nothing, for the smoke test."""

    def __init__(self, seed, first, count):
        self.seed, self.first, self.count = seed, first, count

    def __len__(self):
        return self.count

    def __getitem__(self, i):
        random = np.random.default_rng((self.seed, self.first + i))
        shape = SHAPES[0]
        sem = random.integers(0, CLASSES + 1, shape)
        sem[sem == CLASSES] = IGNORED
        log_depth = random.uniform(LOG_NEAR, LOG_FAR, shape)
        known = random.random(shape) < 0.5
        labels = random.random(shape), log_depth, known, random.uniform(LOG_NEAR, LOG_FAR, shape), random.random(5)
        return tensors(random.random((*shape, 3)), sem, *labels)


def losses(network, batch):
    """The four losses; depth counts six times, being the smallest (a guess)."""
    image, sem, dist, log_depth, known, ground, camera = batch
    with torch.cpu.amp.autocast():
        outputs = network.parts(image.to(memory_format=torch.channels_last))
    logits, found_dist, found_ground, relief, found_camera = (output.float() for output in outputs)
    depth = 6 * depth_loss(found_ground, relief, log_depth, known, ground, sem)
    return [semantic_loss(logits, sem), dist_loss(found_dist, dist, sem), depth, camera_loss(found_camera, camera)]


def relief_gain(network, folders):
    """What the relief of plants in the pictures held out is to be multiplied by to be right on the whole, by least squares:
    it is learned too small (0.72 of the truth after 5,000 steps)."""
    found, true = [], []
    with torch.no_grad():
        for folder in folders:
            for i in folder.held_out:
                rgb, *labels = folder.image(i)
                image, sem, _, log_depth, known, ground, _ = tensors(rgb.astype(np.float32) / 255, *labels)
                logits, _, _, relief, _ = network.parts(image[None])
                plants = (sem > 0) & (known > 0) & torch.isfinite(ground) & (logits[0].argmax(0) > 0)
                if plants.sum() >= MIN_PIXELS:
                    found.append(float(relief[0, 0][plants].mean()))
                    true.append(float((ground - log_depth)[plants].mean()))
    return np.dot(found, true) / np.dot(found, found) if found else 1.0


def judge(network, folders):
    """Figures on what was held out, as the network is used: single precision, nothing randomised."""
    figures = Figures()
    with torch.no_grad():
        for folder in folders:
            for i in folder.held_out:
                rgb, *labels = folder.image(i)
                image, *labels = (tensor[None] for tensor in tensors(rgb.astype(np.float32) / 255, *labels))
                figures.add(*network(image), *labels)
    return figures.report()


def main():
    args = arguments("organ2d", "`demeter synth images`")
    torch.set_num_threads(1)
    folders = [Folder(path) for path in args.data]
    endless = 1 << 40

    def samples(first):
        return Noise(args.seed, first, endless) if args.smoke else Randomised(folders, args.seed, first, endless, BATCH)

    args.work.mkdir(parents=True, exist_ok=True)
    checkpoint = args.work / "checkpoint.pt"
    torch.manual_seed(args.seed)
    run = Run(Organ2d().to(memory_format=torch.channels_last), LEARNING_RATE, args.start)
    if checkpoint.exists():
        run.resume(checkpoint)
    if run.seconds < args.minutes * 60:
        batches = torch.utils.data.DataLoader(samples(run.step * BATCH), BATCH, num_workers=1, prefetch_factor=4)
        most_steps = 20 if args.smoke else endless
        run.train(batches, lambda batch: [losses(run.network, batch)], args.minutes, most_steps, checkpoint)
    network = run.average.to(memory_format=torch.contiguous_format)
    gain = relief_gain(network, folders)
    network.scale_relief(gain)
    provenance = {
        "command": command(),
        "seed": args.seed,
        "steps": run.earlier_steps + run.step,
        "program": f"train_organ2d.py, PyTorch {torch.__version__}, NumPy {np.__version__}",
        "data": [
            {"images": f.meta["count"], **{key: f.meta[key] for key in ("seed", "program")}, "sha256": f.sha256()}
            for f in folders
        ],
        "figures": {} if args.smoke else judge(network, folders) | {"relief_gain": round(gain, 4)},
    }
    print(provenance["figures"], flush=True)
    export2d.write(network, args.out, args.version, provenance)
    print(f"wrote {args.out / 'organ2d.onnx'}", flush=True)


if __name__ == "__main__":
    main()
