"""organ2d and relief2d: one residual U-Net of 0.9 million parameters with two ways to tell depth, made of plain convolutions, with one look at the whole picture.

Plain convolutions beat depthwise ones on a CPU (spec/models.md). All work is done at half the picture's size or less:
the last convolution gives each pixel's four quarters as channels, so that thin stems keep their full resolution.
What needs the whole picture is pooled where it is smallest: the camera, and the plane that the ground (or a wall) is.
"""

import torch
from torch import nn
from torch.nn import functional as F

WIDTHS = (24, 48, 64, 96)
CLASSES = 4
# Where the plane's inverse depth falls below about 1 / INVERSE_SHARP it bends to INVERSE_LEAST: beyond the horizon no
# depth is negative. Units are whatever the network chooses, with 1 in the picture's middle at the start. Guesses.
INVERSE_SHARP, INVERSE_LEAST = 20.0, 0.02
# A ground seen from straight above has no slope in the picture: what stands on it is nearer by this part of the ground's
# inverse depth a unit. A guess.
LEVEL_STEEPNESS = 0.3


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


def places(x):
    """Where the pixels of x [n, c, h, w] are: (x, y) [1, 2, h, w], 0 in the picture's middle, x = 1 at its right edge, y
    in the same unit and downwards. What a pinhole camera sees along them is (x t, y t, 1), t = tan(hfov / 2)."""
    height, width = x.shape[2], x.shape[3]
    right = (2 * torch.arange(width) + 1 - width) / width
    down = (2 * torch.arange(height) + 1 - height) / width
    return torch.stack([right[None].expand(height, width), down[:, None].expand(height, width)])[None].float()


def log_nearness(inverse):
    """The logarithm of an inverse depth that is bent to stay above 0."""
    return torch.log(F.softplus(INVERSE_SHARP * inverse) / INVERSE_SHARP + INVERSE_LEAST)


class Whole(nn.Module):
    """From means and first moments of the features over the picture: the camera [n, 6], the plane's inverse depth as a
    linear function of `places` [n, 3], and what every pixel is told [n, width]."""

    def __init__(self, width, hidden=128):
        super().__init__()
        self.first, self.second = nn.Linear(3 * width, hidden), nn.Linear(hidden, hidden)
        self.camera, self.plane, self.told = nn.Linear(hidden, 6), nn.Linear(hidden, 3), nn.Linear(hidden, width)
        for layer, bias in ((self.camera, [-0.6, 0, -0.9, -0.4, -1, -1]), (self.plane, [1, 0, 0]), (self.told, 0)):
            nn.init.zeros_(layer.weight)
            layer.bias.data[:] = torch.tensor(bias)

    def forward(self, x):
        at = places(x)
        moments = [x.mean((2, 3)), (x * at[:, :1]).mean((2, 3)), (x * at[:, 1:]).mean((2, 3))]
        x = F.relu(self.second(F.relu(self.first(torch.cat(moments, 1)))))
        camera = self.camera(x)
        up = camera[:, 1:4] / torch.sqrt((camera[:, 1:4] ** 2).sum(1, keepdim=True) + 1e-6)
        return torch.cat([camera[:, :1], up, camera[:, 4:].clamp(-6, 1)], 1), self.plane(x), self.told(x)


class Eyes(nn.Module):
    """image [n, 3, h, w], RGB in 0..1, sides multiples of 16 -> sem logits [n, 4, h, w], dist in 0..1 [n, 1, h, w],
    log depth up to a constant [n, 1, h, w], camera [n, 6]: ln tan(hfov / 2); up as a unit vector in the camera's
    frame (right, down, forward); ln of the standard deviations to expect of the first (a number) and of up (radians).

    Depth is that of a plane, whose inverse is linear in the picture, less `relief`, which the two networks tell in ways
    of their own."""

    def __init__(self):
        super().__init__()
        self.down = nn.ModuleList(Down(a, b) for a, b in zip((3, *WIDTHS), WIDTHS))
        self.place = nn.Conv2d(2, WIDTHS[-1], 1)
        nn.init.zeros_(self.place.weight)
        # Dilated, because a plant's stems are told apart by where they are on it.
        self.middle = Residual(WIDTHS[-1], dilation=2)
        self.far = Residual(WIDTHS[-1], dilation=4)
        self.whole = Whole(WIDTHS[-1])
        self.up = nn.ModuleList(Up(b, a) for a, b in zip(WIDTHS, WIDTHS[1:]))
        self.head = nn.Conv2d(WIDTHS[0], 4 * (CLASSES + 2), 3, padding=1)

    def forward(self, image):
        sem, dist, ground, relief, camera = self.parts(image)
        return sem, dist, ground - relief, camera

    def parts(self, image):
        """As `forward`, but log depth in two: of the plane that the ground (or a wall) is, and by how much nearer what is
        seen there is."""
        seen = [(image - 0.45) * 4.0]
        for down in self.down:
            seen.append(down(seen[-1]))
        x = self.far(self.middle(seen[-1] + self.place(places(seen[-1]))))
        # Sums over a picture want more digits than bfloat16 has.
        with torch.autocast("cpu", enabled=False):
            camera, plane, told = self.whole(x.float())
        x = x + told[:, :, None, None]
        for up, skip in zip(reversed(self.up), reversed(seen[1:-1])):
            x = up(x, skip)
        x = self.head(x)
        middle, slope = plane[:, :1, None, None], plane[:, 1:, None, None]
        inverse = middle + (slope * places(x)).sum(1, keepdim=True)
        sem, dist, last = x.split((4 * CLASSES, 4, 4), 1)
        relief = self.relief(last.float(), middle, slope, inverse)
        ground = -log_nearness(inverse).repeat(1, 4, 1, 1)
        sem, dist, ground, relief = (F.pixel_shuffle(part, 2) for part in (sem, dist, ground, relief))
        return sem, torch.sigmoid(dist), ground, relief, camera


class Organ2d(Eyes):
    """The head tells how much farther than the plane a pixel is."""

    def relief(self, last, middle, slope, inverse):
        return -last


class Relief2d(Eyes):
    """What stands on a ground is as near as the ground is at its foot, so the head is asked how far below a pixel that
    foot is seen: a local question, which neither the camera's tilt nor the distance enters."""

    def relief(self, foot, middle, slope, inverse):
        middle, slope, plane = middle.detach(), slope.detach(), inverse.detach()
        steepness = torch.sqrt((slope**2).sum(1, keepdim=True) + (LEVEL_STEEPNESS * middle) ** 2)
        return log_nearness(plane + steepness * foot) - log_nearness(plane)


# The share of relief that relief2d.onnx tells. How high plants are is hardly seen: on pictures held out half of what was
# learned is as near the truth as all of it (0.1012 and 0.1011, 0.1007 at best), and the less is told the less can be wrong.
RELIEF_TOLD = 0.5


class Depth(nn.Module):
    """What relief2d.onnx holds of its network: depth. Organs and the camera are taught beside it, for they help depth (as
    organ2d's depth helps its organs), and are left to organ2d in use."""

    def __init__(self, network):
        super().__init__()
        self.network = network

    def forward(self, image):
        _, _, ground, relief, _ = self.network.parts(image)
        return ground - RELIEF_TOLD * relief
