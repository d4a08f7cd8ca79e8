"""organ2d: a residual U-Net of 0.6 million parameters, made of plain convolutions.

Plain convolutions beat depthwise ones on a CPU (spec/models.md). All work is done at half the picture's size or less:
the last convolution gives each pixel's four quarters as channels, so that thin stems keep their full resolution.
"""

import torch
from torch import nn
from torch.nn import functional as F

WIDTHS = (24, 48, 64, 96)
CLASSES = 4


def convolution(inputs, outputs, stride=1, dilation=1):
    weights = nn.Conv2d(inputs, outputs, 3, stride, padding=dilation, dilation=dilation, bias=False)
    return nn.Sequential(weights, nn.BatchNorm2d(outputs))


class Residual(nn.Module):
    """Two convolutions beside the identity (He et al. 2016)."""

    def __init__(self, width, dilation=1):
        super().__init__()
        self.first = convolution(width, width, dilation=dilation)
        self.second = convolution(width, width, dilation=dilation)

    def forward(self, x):
        return F.relu(x + self.second(F.relu(self.first(x))))


class Down(nn.Module):
    """Half the size, another width, one residual block."""

    def __init__(self, inputs, outputs):
        super().__init__()
        self.halve = convolution(inputs, outputs, stride=2)
        self.block = Residual(outputs)

    def forward(self, x):
        return self.block(F.relu(self.halve(x)))


class Up(nn.Module):
    """Twice the size by repetition, added to what the way down saw there, one residual block."""

    def __init__(self, inputs, outputs):
        super().__init__()
        self.narrow = nn.Sequential(nn.Conv2d(inputs, outputs, 1, bias=False), nn.BatchNorm2d(outputs))
        self.block = Residual(outputs)

    def forward(self, x, skip):
        return self.block(F.relu(skip + F.interpolate(self.narrow(x), scale_factor=2.0, mode="nearest")))


class Organ2d(nn.Module):
    """image [n, 3, h, w], RGB in 0..1, sides multiples of 16 -> sem logits [n, 4, h, w], dist in 0..1 [n, 1, h, w],
    log depth up to a constant [n, 1, h, w]."""

    def __init__(self):
        super().__init__()
        self.down = nn.ModuleList(Down(a, b) for a, b in zip((3, *WIDTHS), WIDTHS))
        # Dilated, because a plant's stems are told apart by where they are on it.
        self.middle = Residual(WIDTHS[-1], dilation=2)
        self.up = nn.ModuleList(Up(b, a) for a, b in zip(WIDTHS, WIDTHS[1:]))
        self.head = nn.Conv2d(WIDTHS[0], 4 * (CLASSES + 2), 3, padding=1)

    def forward(self, image):
        seen = [(image - 0.45) * 4.0]
        for down in self.down:
            seen.append(down(seen[-1]))
        x = self.middle(seen[-1])
        for up, skip in zip(reversed(self.up), reversed(seen[1:-1])):
            x = up(x, skip)
        x = F.pixel_shuffle(self.head(x), 2)
        return x[:, :CLASSES], torch.sigmoid(x[:, CLASSES : CLASSES + 1]), x[:, CLASSES + 1 :]
