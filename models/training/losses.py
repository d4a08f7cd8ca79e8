"""What training minimises, and the figures it is judged by."""

import math

import numpy as np
import torch
from torch.nn import functional as F

from images import IGNORED
from network import CLASSES

# Stems cover few pixels; without weight they are traded for leaf edges. A guess.
CLASS_WEIGHTS = torch.tensor([1.0, 1.0, 2.5, 2.5])
# Weight of a bare pixel's relief beside a plant's, and share of the bare pixels that counts among plants', so that a
# picture with few plants is none but ground. Guesses.
BARE_WEIGHT, BARE_SHARE = 0.2, 0.1
# Errors of the logarithm of depth above this count by themselves, smaller ones by their squares. A guess.
LARGE_ERROR = 0.3
# Differences between neighbours keep edges; most are smaller than their mean, so with more weight plants come out flat
# (tried: 0.5, and relief was 0.63 of the truth).
STEP_WEIGHT = 0.05


def semantic_loss(logits, sem):
    """Cross entropy, and Dice over the organ classes because they are thin."""
    entropy = F.cross_entropy(logits, sem, CLASS_WEIGHTS, ignore_index=IGNORED)
    seen = (sem != IGNORED).float()[:, None]
    p = logits.softmax(1) * seen
    truth = F.one_hot(sem.clamp(max=CLASSES - 1), CLASSES).permute(0, 3, 1, 2) * seen
    both = (p * truth).sum((0, 2, 3))
    dice = 1 - (2 * both + 1) / (p.sum((0, 2, 3)) + truth.sum((0, 2, 3)) + 1)
    return entropy + 0.5 * dice[1:].mean()


def dist_loss(found, dist, sem):
    """L1 on organs; the label means nothing elsewhere. No weight may grow with the label: L1 seeks the weighted median,
    which then lies at 1 (tried: dist came out as 1 on every organ)."""
    organ = ((sem > 0) & (sem != IGNORED)).float()
    return (organ * (found[:, 0] - dist).abs()).sum() / organ.sum().clamp(min=1)


def depth_loss(found_ground, relief, log_depth, known, ground, sem):
    """Errors of two logarithms of depth: of the plane of the ground, up to a constant, and of how much nearer
    than the ground beneath it everything is, which is a number without a scale: by it a plant is measured in heights of
    the camera. Where no ground is known (before walls, on benches) the plane is the background, and plants are taught up
    to a constant of their own: how far a wall is says nothing of a plant."""
    found_ground, relief = found_ground[:, 0], relief[:, 0]
    beneath = torch.isfinite(ground) & (sem != IGNORED)
    grounded = beneath.flatten(1).any(1)[:, None, None]
    ground = torch.where(beneath, ground, torch.zeros(()))
    seen = (known > 0) & (sem != IGNORED) & (beneath | ~grounded)
    organ, bare = (seen & (sem > 0)).float(), (seen & (sem == 0)).float()
    plane = torch.where(grounded, beneath.float(), bare)
    off_plane = centred(found_ground - torch.where(grounded, ground, log_depth), plane)
    plane_loss = mean_of_pictures(plane * off_plane.abs(), plane.sum((1, 2)))
    standing = ground - relief - log_depth
    error = torch.where(grounded, standing, centred(found_ground - relief - log_depth, organ))
    error = torch.where((bare > 0) & ~grounded, relief, error)
    total = organ.sum((1, 2)) + BARE_SHARE * bare.sum((1, 2))
    # Near zero the square, whose mean is right: the median of what cannot be told is no relief at all (tried: plants came
    # out at a third of their height).
    off = F.smooth_l1_loss(error, torch.zeros_like(error), reduction="none", beta=LARGE_ERROR)
    return plane_loss + mean_of_pictures((organ + BARE_WEIGHT * bare) * off, total) + STEP_WEIGHT * steps(error, organ)


def centred(error, weight):
    """The error less its mean in each picture."""
    return error - ((weight * error).sum((1, 2)) / weight.sum((1, 2)).clamp(min=1))[:, None, None]


def mean_of_pictures(error, total):
    """Sums of pictures over their totals; every picture with any counts alike."""
    return (error.sum((1, 2)) / total.clamp(min=1)).sum() / (total > 0).sum().clamp(min=1)


def steps(error, weight):
    """L1 on its differences between neighbours, which keeps edges."""
    down, right = weight[:, 1:] * weight[:, :-1], weight[:, :, 1:] * weight[:, :, :-1]
    steps_down = mean_of_pictures(down * (error[:, 1:] - error[:, :-1]).abs(), down.sum((1, 2)))
    return steps_down + mean_of_pictures(right * (error[:, :, 1:] - error[:, :, :-1]).abs(), right.sum((1, 2)))


def camera_errors(found, camera):
    """Absolute error of ln tan(hfov / 2), and of up (the chord between the two, nearly radians): [n] each."""
    return (found[:, 0] - camera[:, 0]).abs(), (found[:, 1:4] - camera[:, 1:4]).norm(dim=1)


def camera_loss(found, camera):
    """The two errors; the deviations learn to tell how large they will be (the negative logarithm of a normal density)
    without pulling at what errs. The weights are guesses."""
    field, up = camera_errors(found, camera)
    log_field, log_up = found[:, 4], found[:, 5]
    density = 0.5 * (field.detach() / log_field.exp()) ** 2 + log_field
    # Up errs in two directions.
    density = density + 0.5 * (up.detach() / log_up.exp()) ** 2 + 2 * log_up
    known = camera[:, 4]
    return (known * (field + 2 * up + 0.02 * density)).sum() / known.sum().clamp(min=1)


class Figures:
    """Intersection over union of each class, mean absolute error of dist on organs, the standard deviation of the error
    of log depth within an image, on organs (mean over the images), and median errors of the camera."""

    def __init__(self):
        self.both, self.either = torch.zeros(CLASSES), torch.zeros(CLASSES)
        self.dist_error, self.organ_pixels, self.spreads = 0.0, 0, []
        self.fields, self.ups = [], []

    def add(self, sem_logits, found_dist, found_depth, found_camera, sem, dist, log_depth, known, ground, camera):
        best = sem_logits.argmax(1)
        for c in range(CLASSES):
            self.both[c] += ((best == c) & (sem == c)).sum()
            self.either[c] += ((best == c) | (sem == c)).sum()
        organ = sem > 0
        self.dist_error += float((found_dist[:, 0] - dist).abs()[organ].sum())
        self.organ_pixels += int(organ.sum())
        for error, here in zip(found_depth[:, 0] - log_depth, organ & (known > 0)):
            if here.sum() > 1:
                self.spreads.append(float(error[here].std()))
        _, up = camera_errors(found_camera, camera)
        angle = [2 * math.atan(math.exp(value)) for value in (found_camera[0, 0], camera[0, 0])]
        self.fields.append(abs(angle[0] / angle[1] - 1))
        self.ups.append(math.degrees(2 * math.asin(float(up[0]) / 2)))

    def report(self):
        iou = (self.both / self.either.clamp(min=1)).tolist()
        names = ("background", "leaf", "stem", "main_stem")
        figures = {f"iou_{name}": value for name, value in zip(names, iou)}
        figures["miou"] = sum(iou) / CLASSES
        figures["dist_mae_on_organs"] = self.dist_error / max(1, self.organ_pixels)
        figures["log_depth_std_on_organs"] = sum(self.spreads) / max(1, len(self.spreads))
        figures["hfov_relative_error_median"] = float(np.median(self.fields))
        figures["tilt_degrees_median"] = float(np.median(self.ups))
        return {name: round(value, 4) for name, value in figures.items()}
