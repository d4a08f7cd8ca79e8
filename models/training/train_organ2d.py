#!/usr/bin/python3
"""Trains organ2d: see README.md beside this file."""

import argparse
import copy
import math
import os
import pathlib
import shlex
import sys
import tempfile
import time

# One thread: PyTorch's own threads wait actively and take the machine from everyone else.
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")

import numpy as np
import torch

import export
from images import IGNORED, LOG_FAR, LOG_NEAR, SIDE, Folder, Randomised, tensors
from losses import Figures, depth_loss, dist_loss, semantic_loss
from network import CLASSES, Organ2d

BATCH = 8
LEARNING_RATE = 2e-3
WARM_UP_STEPS = 100
SAVE_EVERY_SECS = 60
AVERAGED = 0.998
MODELS = pathlib.Path(__file__).resolve().parent.parent
CHECKPOINTS = MODELS.parent / ".cache/training/organ2d"


def arguments():
    parser = argparse.ArgumentParser(description="Trains organ2d and writes organ2d.onnx, its manifest and its pins.")
    parser.add_argument("--data", action="append", default=[], metavar="DIR", help="of `demeter synth images`")
    parser.add_argument("--minutes", type=float, default=55.0, help="time for this run, over all its restarts")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--work", type=pathlib.Path, default=CHECKPOINTS, help="where checkpoints go")
    parser.add_argument("--from", dest="start", type=pathlib.Path, metavar="FILE", help="begin with these weights")
    parser.add_argument("--out", type=pathlib.Path, default=MODELS, help="where organ2d.onnx goes")
    parser.add_argument("--version", default="1", help="the manifest's version")
    parser.add_argument("--smoke", action="store_true", help="20 steps on noise, written to a temporary folder")
    return parser.parse_args()


class Noise(torch.utils.data.Dataset):
    """Samples of nothing, for the smoke test."""

    def __init__(self, seed, first, count):
        self.seed, self.first, self.count = seed, first, count

    def __len__(self):
        return self.count

    def __getitem__(self, i):
        random = np.random.default_rng((self.seed, self.first + i))
        shape = (SIDE, SIDE)
        sem = random.integers(0, CLASSES + 1, shape)
        sem[sem == CLASSES] = IGNORED
        log_depth = random.uniform(LOG_NEAR, LOG_FAR, shape)
        return tensors(random.random((*shape, 3)), sem, random.random(shape), log_depth, random.random(shape) < 0.5)


class Run:
    """The state that a checkpoint keeps."""

    def __init__(self, args):
        torch.manual_seed(args.seed)
        self.network = Organ2d().to(memory_format=torch.channels_last)
        self.earlier_steps = 0
        if args.start:
            kept = torch.load(args.start)
            self.network.load_state_dict(kept["average"])
            self.earlier_steps = kept["earlier_steps"] + kept["step"]
        self.average = copy.deepcopy(self.network).eval()
        self.optimiser = torch.optim.AdamW(self.network.parameters(), LEARNING_RATE, weight_decay=1e-2)
        self.step, self.seconds = 0, 0.0

    def save(self, path):
        """Whole or not at all: written beside, then renamed."""
        state = {"step": self.step, "seconds": self.seconds, "earlier_steps": self.earlier_steps}
        state |= {name: getattr(self, name).state_dict() for name in ("network", "average", "optimiser")}
        torch.save(state, path.with_suffix(".part"))
        os.replace(path.with_suffix(".part"), path)

    def resume(self, path):
        kept = torch.load(path)
        for name in ("network", "average", "optimiser"):
            getattr(self, name).load_state_dict(kept[name])
        self.step, self.seconds, self.earlier_steps = kept["step"], kept["seconds"], kept["earlier_steps"]

    def learn(self, batch, part_done):
        """One step; `part_done` is how much of the run's time is over."""
        image, sem, dist, log_depth, known = batch
        rate = 0.5 * LEARNING_RATE * (1 + math.cos(math.pi * min(1.0, part_done)))
        for group in self.optimiser.param_groups:
            group["lr"] = rate * min(1.0, (self.step + 1) / WARM_UP_STEPS)
        with torch.cpu.amp.autocast():
            outputs = self.network(image.to(memory_format=torch.channels_last))
        logits, found_dist, found_depth = (output.float() for output in outputs)
        parts = [semantic_loss(logits, sem), dist_loss(found_dist, dist, sem)]
        parts.append(depth_loss(found_depth, log_depth, known, sem))
        loss = sum(parts)
        self.optimiser.zero_grad()
        loss.backward()
        # A wild batch must not undo the rest; also the only guard that bfloat16 needs.
        norm = torch.nn.utils.clip_grad_norm_(self.network.parameters(), 2.0)
        if torch.isfinite(norm):
            self.optimiser.step()
        self.step += 1
        keep = min(AVERAGED, self.step / (self.step + 10))
        with torch.no_grad():
            for mean, now in zip(self.average.state_dict().values(), self.network.state_dict().values()):
                if mean.is_floating_point():
                    mean.lerp_(now, 1 - keep)
                else:
                    mean.copy_(now)
        return [float(part) for part in parts]


def train(run, samples, seconds, most_steps, checkpoint):
    """Until the time is over, or for so many steps."""
    loader = torch.utils.data.DataLoader(samples(run.step * BATCH), BATCH, num_workers=1, prefetch_factor=4)
    last, saved, sums = time.monotonic(), time.monotonic(), np.zeros(3)
    for batch in loader:
        sums += run.learn(batch, run.seconds / seconds)
        now = time.monotonic()
        run.seconds, last = run.seconds + now - last, now
        if run.step % 50 == 0:
            print(f"step {run.step}, {run.seconds:.0f} s: sem, dist, depth {(sums / 50).round(4)}", flush=True)
            sums[:] = 0
        over = run.seconds >= seconds or run.step >= most_steps
        if over or now - saved > SAVE_EVERY_SECS:
            run.save(checkpoint)
            saved = now
        if over:
            break


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
    args = arguments()
    torch.set_num_threads(1)
    if args.smoke:
        args.work = args.out = pathlib.Path(tempfile.mkdtemp(prefix="organ2d-smoke-"))
    elif not args.data:
        sys.exit("train_organ2d: expected --data DIR (from `demeter synth images`) or --smoke, found neither")
    folders = [Folder(path) for path in args.data]
    endless = 1 << 40

    def samples(first):
        return Noise(args.seed, first, endless) if args.smoke else Randomised(folders, args.seed, first, endless)

    args.work.mkdir(parents=True, exist_ok=True)
    checkpoint = args.work / "checkpoint.pt"
    run = Run(args)
    if checkpoint.exists():
        run.resume(checkpoint)
        print(f"resumed at step {run.step}, {run.seconds:.0f} s", flush=True)
    if run.seconds < args.minutes * 60:
        train(run, samples, args.minutes * 60, 20 if args.smoke else endless, checkpoint)
    network = run.average.to(memory_format=torch.contiguous_format)
    provenance = {
        "command": "models/training/" + shlex.join([pathlib.Path(sys.argv[0]).name, *sys.argv[1:]]),
        "seed": args.seed,
        "steps": run.earlier_steps + run.step,
        "program": f"train_organ2d.py, PyTorch {torch.__version__}, NumPy {np.__version__}",
        "data": [
            {"images": f.meta["count"], **{key: f.meta[key] for key in ("seed", "program")}, "sha256": f.sha256()}
            for f in folders
        ],
        "figures": {} if args.smoke else judge(network, folders),
    }
    print(provenance["figures"], flush=True)
    export.write_onnx(network, args.out / "organ2d.onnx")
    export.write_manifest(args.out / "organ2d.toml", args.version, provenance)
    export.write_pins(network, args.out / "organ2d.pins.json")
    print(f"wrote {args.out / 'organ2d.onnx'}", flush=True)


if __name__ == "__main__":
    main()
