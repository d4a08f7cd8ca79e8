"""organ3d: a U-Net over points, in plain matrix products, gathers and maxima.

Each level mixes a point with its nearest 16 (after PointNeXt, Qian et al. 2022): what a neighbour knows, and where it
lies from here, through two linear layers and a maximum. The coarsest level, some hundreds of points, also attends to
all of itself. Work at full resolution is one small mixing with the three nearest points of the finest level.
"""

import torch
from torch import nn
from torch.nn import functional as F

from pyramid import LOCAL

CLASSES = 3
WIDTHS = (40, 80, 128)
HEADS = 4
INPUTS = (
    "points", "points0", "points1", "points2", "points3", "up", "below1", "below2", "below3", "beside1", "beside2",
    "beside3", "parent1", "parent2", "local",
)


class Mix(nn.Module):
    """Gathers from the nearest: values [m, inputs] at `places` [m, 3] -> [n, outputs] at `here` [n, 3]."""

    def __init__(self, inputs, outputs):
        super().__init__()
        self.know = nn.Linear(inputs, outputs)
        self.where = nn.Linear(3, outputs)
        self.merge = nn.Linear(outputs, outputs)

    def forward(self, values, places, here, nearest):
        n, k = nearest.shape
        nearest = nearest.reshape(-1)
        # Both are linear, so they are added before they are gathered.
        there = (self.know(values) + self.where(places)).index_select(0, nearest).reshape(n, k, -1)
        x = F.relu(there - F.linear(here, self.where.weight)[:, None])
        return self.merge(x).max(1)[0]


class Forward(nn.Module):
    """Two linear layers beside the identity."""

    def __init__(self, width):
        super().__init__()
        self.norm = nn.LayerNorm(width)
        self.layers = nn.Sequential(nn.Linear(width, 2 * width), nn.ReLU(), nn.Linear(2 * width, width))

    def forward(self, x):
        return x + self.layers(self.norm(x))


class Block(nn.Module):
    """Mixing within a level, beside the identity."""

    def __init__(self, width):
        super().__init__()
        self.norm = nn.LayerNorm(width)
        self.mix = Mix(width, width)
        self.forward_ = Forward(width)

    def forward(self, x, places, beside):
        return self.forward_(x + self.mix(self.norm(x), places, places, beside))


class Attention(nn.Module):
    """Every point of one cloud looks at all of them (Vaswani et al. 2017)."""

    def __init__(self, width):
        super().__init__()
        self.norm = nn.LayerNorm(width)
        self.ask = nn.Linear(width, 3 * width)
        self.answer = nn.Linear(width, width)
        self.forward_ = Forward(width)

    def forward(self, x):
        n, width = x.shape
        q, k, v = self.ask(self.norm(x)).reshape(n, 3, HEADS, width // HEADS).permute(1, 2, 0, 3).unbind(0)
        weights = (q @ k.transpose(1, 2) * (width // HEADS) ** -0.5).softmax(-1)
        return self.forward_(x + self.answer((weights @ v).transpose(0, 1).reshape(n, width)))


class Organ3d(nn.Module):
    """Inputs as INPUTS names them (recon/src/pyramid.rs) -> semantic logits [n, 3] (leaf, stem, main stem), truncated
    inverse distance [n, 1]."""

    def __init__(self):
        super().__init__()
        a, b, c = WIDTHS
        self.enter = Mix(1, a)
        self.local = nn.Linear(LOCAL + 3, a)
        self.first = Block(a)
        self.down2, self.down3 = Mix(a, b), Mix(b, c)
        self.second = nn.ModuleList([Block(b), Block(b)])
        self.place = nn.Linear(3, c)
        self.third = nn.ModuleList([Block(c), Block(c)])
        self.attention = nn.ModuleList([Attention(c), Attention(c)])
        self.up2, self.up1 = nn.Linear(c, b), nn.Linear(b, a)
        self.second_again, self.first_again = Block(b), Block(a)
        self.norm1 = nn.LayerNorm(a)
        self.ask = Mix(a, a)
        self.head = nn.Linear(a, CLASSES + 1)

    def forward(
        self, points, points0, points1, points2, points3, up, below1, below2, below3, beside1, beside2, beside3,
        parent1, parent2, local,
    ):
        share = local[:1, -1:]
        # How high a point of level 0 lies says which part of the plant this is; also gives Mix something to know.
        x1 = self.enter(points0[:, 2:] * share, points0, points1, below1)
        x1 = self.first(x1 + self.local(torch.cat([local, points1 * share], 1)), points1, beside1)
        x2 = self.down2(x1, points1, points2, below2)
        for block in self.second:
            x2 = block(x2, points2, beside2)
        x3 = self.down3(x2, points2, points3, below3) + self.place(points3 * share)
        for block, attention in zip(self.third, self.attention):
            x3 = attention(block(x3, points3, beside3))
        x2 = self.second_again(x2 + self.up2(x3).index_select(0, parent2), points2, beside2)
        x1 = self.first_again(x1 + self.up1(x2).index_select(0, parent1), points1, beside1)
        x = self.head(F.relu(self.ask(self.norm1(x1), points1, points, up)))
        return x[:, :CLASSES], torch.sigmoid(x[:, CLASSES:])
