#!/usr/bin/python3
"""Trains organ3d: see README.md beside this file."""

import copy
import os

# One thread: PyTorch's own threads wait actively and take the machine from everyone else.
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")

import numpy as np
import scipy
import torch
from torch.nn import functional as F

import clouds
import export3d
from network3d import CLASSES, Organ3d
from run import Run, arguments, command

BATCH = 2
LEARNING_RATE = 2e-3
# Without weight thin petioles are traded for leaf edges. A guess.
CLASS_WEIGHTS = torch.tensor([1.0, 2.0, 1.5])
BOUNDARY_WEIGHT = 2.0
# How often each held-out plant is scanned anew to judge the network.
JUDGED_SCANS = 4


class Noise(torch.utils.data.Dataset):
    """Samples of nothing, for the smoke test."""

    def __init__(self, seed, first):
        self.seed, self.first = seed, first

    def __len__(self):
        return 1 << 40

    def __getitem__(self, i):
        random = np.random.default_rng((self.seed, self.first + i))
        points = random.random((500, 3))
        noise = {"points": points, "axis": points, "sem": random.integers(0, CLASSES, 500), "distance": points[:, 0]}
        return clouds.sample(noise, random)


def losses(logits, found, sem, truth):
    """Cross entropy with Dice, because stems are thin; and L1 of the truncated inverse distance."""
    p, one = logits.softmax(1), F.one_hot(sem, CLASSES)
    dice = 1 - (2 * (p * one).sum(0) + 1) / (p.sum(0) + one.sum(0) + 1)
    semantic = F.cross_entropy(logits, sem, CLASS_WEIGHTS) + 0.5 * dice.mean()
    return [semantic / BATCH, BOUNDARY_WEIGHT * (found[:, 0] - truth).abs().mean() / BATCH]


def unweighted(network):
    """The network with odds as they are: training with weighted classes multiplies them by the weights."""
    network = copy.deepcopy(network)
    with torch.no_grad():
        network.head.bias[:CLASSES] -= CLASS_WEIGHTS.log()
    return network


def judge(network, folders, seed):
    """Figures on scans of what was held out."""
    confusion, error, asked = np.zeros((CLASSES, CLASSES)), 0.0, 0
    with torch.no_grad():
        for number, folder in enumerate(folders):
            for i in folder.held_out * JUDGED_SCANS:
                random = np.random.default_rng((seed, 1 << 41, number, i, asked))
                inputs, sem, truth = clouds.sample(folder.clouds[i], random)
                logits, found = network(**inputs)
                np.add.at(confusion, (sem.numpy(), logits.argmax(1).numpy()), 1)
                error += float((found[:, 0] - truth).abs().sum())
                asked += len(sem)
    return figures(confusion) | {"boundary_mae": round(error / asked, 4)}


def figures(confusion):
    """Intersection over union of each class, of leaf and stems merged, and the share of stem points (taken as stems)
    of which the main stem is told right from the others. `confusion` [truth, found]."""
    iou = lambda c: c[0, 0] / max(1, c[0].sum() + c[:, 0].sum() - c[0, 0])
    each = [iou(np.roll(confusion, (-c, -c), (0, 1))) for c in range(CLASSES)]
    stems = confusion[1:, 1:]
    merged = np.array([[stems.sum(), confusion[1:, 0].sum()], [confusion[0, 1:].sum(), confusion[0, 0]]])
    told = {f"iou_{name}": value for name, value in zip(("leaf", "stem", "main_stem"), each)}
    told |= {"miou": np.mean(each), "miou_leaf_stems": (iou(merged) + iou(merged[::-1, ::-1])) / 2}
    told["main_stem_told"] = np.trace(stems) / max(1, stems.sum())
    return {name: round(float(value), 4) for name, value in told.items()}


def main():
    args = arguments("organ3d", "tools/training-clouds.sh")
    torch.set_num_threads(1)
    torch.manual_seed(args.seed)
    args.work.mkdir(parents=True, exist_ok=True)
    folders = [clouds.Clouds(path, args.work / "clouds") for path in args.data]
    run = Run(Organ3d(), LEARNING_RATE, args.start)
    checkpoint = args.work / "checkpoint.pt"
    if checkpoint.exists():
        run.resume(checkpoint)
    if run.seconds < args.minutes * 60:
        first = run.step * BATCH
        samples = Noise(args.seed, first) if args.smoke else clouds.Randomised(folders, args.seed, first)
        batches = torch.utils.data.DataLoader(samples, BATCH, collate_fn=list, num_workers=1, prefetch_factor=4)
        learn = lambda batch: (losses(*run.network(**inputs), sem, truth) for inputs, sem, truth in batch)
        run.train(batches, learn, args.minutes, 20 if args.smoke else 1 << 40, checkpoint)
    network = unweighted(run.average)
    provenance = {
        "command": command(),
        "seed": args.seed,
        "steps": run.earlier_steps + run.step,
        "program": f"train_organ3d.py, PyTorch {torch.__version__}, NumPy {np.__version__}, SciPy {scipy.__version__}",
        "data": [f.provenance() for f in folders],
        "figures": {} if args.smoke else judge(network, folders, args.seed),
    }
    print(provenance["figures"], flush=True)
    export3d.write(network, args.out, args.version, provenance)
    print(f"wrote {args.out / 'organ3d.onnx'}", flush=True)


if __name__ == "__main__":
    main()
