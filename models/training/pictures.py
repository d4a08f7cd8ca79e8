"""The training of organ2d and relief2d, which learn the same from pictures."""

import os

# One thread: PyTorch's own threads wait actively and take the machine from everyone else.
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")

import numpy as np
import torch

import export2d
from images import IGNORED, LOG_FAR, LOG_NEAR, SHAPES, Folder, Randomised, tensors
from losses import Figures, camera_loss, depth_loss, dist_loss, semantic_loss
from network import CLASSES
from run import Run, arguments, command

BATCH = 8
LEARNING_RATE = 2e-3


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


def train(kind):
    """Trains a network of this class as the command line says, and writes it."""
    args = arguments(kind.__name__.lower(), "`demeter synth images`")
    torch.set_num_threads(1)
    folders = [Folder(path) for path in args.data]
    endless = 1 << 40

    def samples(first):
        return Noise(args.seed, first, endless) if args.smoke else Randomised(folders, args.seed, first, endless, BATCH)

    args.work.mkdir(parents=True, exist_ok=True)
    checkpoint = args.work / "checkpoint.pt"
    torch.manual_seed(args.seed)
    run = Run(kind().to(memory_format=torch.channels_last), LEARNING_RATE, args.start)
    if checkpoint.exists():
        run.resume(checkpoint)
    if run.seconds < args.minutes * 60:
        batches = torch.utils.data.DataLoader(samples(run.step * BATCH), BATCH, num_workers=1, prefetch_factor=4)
        most_steps = 20 if args.smoke else endless
        run.train(batches, lambda batch: [losses(run.network, batch)], args.minutes, most_steps, checkpoint)
    network = run.average.to(memory_format=torch.contiguous_format)
    provenance = {
        "command": command(),
        "seed": args.seed,
        "steps": run.earlier_steps + run.step,
        "program": f"pictures.py, PyTorch {torch.__version__}, NumPy {np.__version__}",
        "data": [
            {"images": f.meta["count"], **{key: f.meta[key] for key in ("seed", "program")}, "sha256": f.sha256()}
            for f in folders
        ],
        "figures": {} if args.smoke else judge(network, folders),
    }
    print(provenance["figures"], flush=True)
    export2d.write(network, args.out, args.version, provenance)
    print(f"wrote to {args.out}", flush=True)
