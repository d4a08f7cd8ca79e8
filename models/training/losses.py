"""What training minimises, and the figures it is judged by."""

import math

import numpy as np
import torch
from torch.nn import functional as F

from images import IGNORED
from network import CLASSES

# Stems cover few pixels; without weight they are traded for leaf edges. A guess.
CLASS_WEIGHTS = torch.tensor([1.0, 1.0, 2.5, 2.5])
# Soil teaches depth too, but plants are what depth is for. A guess.
GROUND_WEIGHT = 0.25


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


def depth_loss(found, log_depth, known, sem):
    """Variance of the error of log depth (Eigen et al. 2014, eq. 3 with lambda = 1), and L1 on its differences between
    neighbours, which keeps edges."""
    weight = known * torch.where((sem > 0) & (sem != IGNORED), 1.0, GROUND_WEIGHT)
    error = found[:, 0] - log_depth
    total = weight.sum((1, 2)).clamp(min=1)
    mean = (weight * error).sum((1, 2)) / total
    variance = (weight * (error - mean[:, None, None]) ** 2).sum((1, 2)) / total
    down, right = weight[:, 1:] * weight[:, :-1], weight[:, :, 1:] * weight[:, :, :-1]
    step_down = (down * (error[:, 1:] - error[:, :-1]).abs()).sum((1, 2))
    step_right = (right * (error[:, :, 1:] - error[:, :, :-1]).abs()).sum((1, 2))
    return (variance + 0.5 * (step_down + step_right) / total).mean()


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

    def add(self, sem_logits, found_dist, found_depth, found_camera, sem, dist, log_depth, known, camera):
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
