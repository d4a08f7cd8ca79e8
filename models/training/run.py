"""The command line of a training run, and the run itself, which can be stopped and continued: what a checkpoint keeps,
and the loop around it."""

import argparse
import copy
import math
import os
import pathlib
import shlex
import sys
import tempfile
import time

import numpy as np
import torch

WARM_UP_STEPS = 100
SAVE_EVERY_SECS = 60
LOG_EVERY_STEPS = 50
AVERAGED = 0.998
LARGEST_GRADIENT = 2.0
MODELS = pathlib.Path(__file__).resolve().parent.parent


def arguments(network, data):
    """The options of a network's training; `data` says what makes its data."""
    parser = argparse.ArgumentParser(description=f"Trains {network} and writes {network}.onnx, its manifest and its pins.")
    parser.add_argument("--data", action="append", default=[], metavar="DIR", help=f"of {data}")
    parser.add_argument("--minutes", type=float, default=55.0, help="time for this run, over all its restarts")
    parser.add_argument("--seed", type=int, default=1)
    checkpoints = MODELS.parent / ".cache/training" / network
    parser.add_argument("--work", type=pathlib.Path, default=checkpoints, help="where checkpoints go")
    parser.add_argument("--from", dest="start", type=pathlib.Path, metavar="FILE", help="begin with these weights")
    parser.add_argument("--out", type=pathlib.Path, default=MODELS, help=f"where {network}.onnx goes")
    parser.add_argument("--version", default="1", help="the manifest's version")
    parser.add_argument("--smoke", action="store_true", help="20 steps on noise, written to a temporary folder")
    args = parser.parse_args()
    if args.smoke:
        args.work = args.out = pathlib.Path(tempfile.mkdtemp(prefix=f"{network}-smoke-"))
    elif not args.data:
        parser.error(f"expected --data DIR (from {data}) or --smoke, found neither")
    return args


def command():
    """This command, as a manifest keeps it."""
    return "models/training/" + shlex.join([pathlib.Path(sys.argv[0]).name, *sys.argv[1:]])


class Run:
    """The network, the running average of its weights (which is what ships) and the optimiser."""

    def __init__(self, network, learning_rate, start=None):
        self.network, self.learning_rate, self.earlier_steps = network, learning_rate, 0
        if start:
            kept = torch.load(start)
            # Parts that the earlier network had not begin as they are.
            print(self.network.load_state_dict(kept["average"], strict=False), flush=True)
            self.earlier_steps = kept["earlier_steps"] + kept["step"]
        self.average = copy.deepcopy(self.network).eval()
        self.optimiser = torch.optim.AdamW(self.network.parameters(), learning_rate, weight_decay=1e-2)
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
        print(f"resumed at step {self.step}, {self.seconds:.0f} s", flush=True)

    def descend(self, losses, part_done):
        """One step down the sum of `losses`, an iterable of one list of parts a sample, each asked for in turn so that
        only one sample's graph lives at a time; `part_done` is how much of the run's time is over."""
        rate = 0.5 * self.learning_rate * (1 + math.cos(math.pi * min(1.0, part_done)))
        for group in self.optimiser.param_groups:
            group["lr"] = rate * min(1.0, (self.step + 1) / WARM_UP_STEPS)
        self.optimiser.zero_grad()
        told = []
        for parts in losses:
            sum(parts).backward()
            told.append([float(part) for part in parts])
        # A wild batch must not undo the rest; also the only guard that bfloat16 needs.
        norm = torch.nn.utils.clip_grad_norm_(self.network.parameters(), LARGEST_GRADIENT)
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
        return np.mean(told, 0)

    def train(self, batches, losses, minutes, most_steps, checkpoint):
        """Until the time is over, or for so many steps. `losses(batch)` is what `descend` takes."""
        last, saved, told, whole = time.monotonic(), time.monotonic(), [], minutes * 60
        for batch in batches:
            told.append(self.descend(losses(batch), self.seconds / whole))
            now = time.monotonic()
            self.seconds, last = self.seconds + now - last, now
            if self.step % LOG_EVERY_STEPS == 0:
                print(f"step {self.step}, {self.seconds:.0f} s: losses {np.mean(told, 0).round(4)}", flush=True)
                told = []
            over = self.seconds >= whole or self.step >= most_steps
            if over or now - saved > SAVE_EVERY_SECS:
                self.save(checkpoint)
                saved = now
            if over:
                break
