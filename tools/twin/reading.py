"""The shipped CLIP's image tower and a key's decoder: from pictures to logits."""

import json
from pathlib import Path

import torch
from safetensors.torch import load_file
from torch.nn import functional

LEAST, CORNERS = -2.0, 6


class Tower(torch.nn.Module):
    """Mean sines of the colours of pixels at three scales, pixels weighed by how rare their colours are; a linear head."""

    def __init__(self, folder: Path) -> None:
        super().__init__()
        config = json.loads((folder / "config.json").read_text())
        layers = config["model_cfg"]["vision_cfg"]["layers"]
        self.side = config["model_cfg"]["vision_cfg"]["image_size"]
        self.equalization, self.scales = layers["equalization"], layers["scales"]
        preprocess = config["preprocess_cfg"]
        self.mean, self.deviation = (torch.tensor(preprocess[name]).view(3, 1, 1) for name in ("mean", "std"))
        weights = {name: value.float() for name, value in load_file(folder / "model.safetensors").items()}
        scales = range(len(self.scales))
        self.filters = [weights[f"visual.scales.{at}.weight"].view(-1, 3) for at in scales]
        self.phases = [weights[f"visual.scales.{at}.bias"] for at in scales]
        self.head = weights["visual.proj.weight"], weights["visual.proj.bias"]

    def forward(self, pictures: torch.Tensor) -> torch.Tensor:
        """Features of pictures `[views, 3, side, side]`."""
        normalised = (pictures - self.mean) / self.deviation
        sums = []
        for scale, filters, phases in zip(self.scales, self.filters, self.phases):
            pixels = (normalised if scale == 1 else functional.avg_pool2d(normalised, scale)).flatten(2)
            angles = torch.matmul(filters, pixels) + phases[:, None]
            sums.append((angles.sin() * self.weights(pixels.detach())[:, None]).sum(2))
        return functional.normalize(functional.linear(torch.cat(sums, 1), *self.head))

    def weights(self, pixels: torch.Tensor) -> torch.Tensor:
        """Weights `[views, n]` of normalised pixels `[views, 3, n]`: their colours' density to a power, 1 in all."""
        at = (pixels - LEAST).clamp(0, CORNERS - 1)
        corner = at.floor().clamp(max=CORNERS - 2)
        to_next = at - corner
        first = corner.long()
        first = (first[:, 0] * CORNERS + first[:, 1]) * CORNERS + first[:, 2]
        grid = torch.zeros(len(pixels), CORNERS**3)
        corners = []
        for i in range(8):
            far = [i >> 2, i >> 1 & 1, i & 1]
            shares = [to_next[:, k] if far[k] else 1 - to_next[:, k] for k in range(3)]
            behind = (far[0] * CORNERS + far[1]) * CORNERS + far[2]
            corners.append((first + behind, shares[0] * shares[1] * shares[2]))
        for index, share in corners:
            grid = grid.scatter_add(1, index, share)
        density = sum(share * grid.gather(1, index) for index, share in corners).clamp(min=0.125)
        weights = density.pow(-self.equalization)
        return weights / weights.sum(1, keepdim=True)


class Reader(torch.nn.Module):
    """A key's projection and decoder."""

    def __init__(self, key: Path) -> None:
        super().__init__()
        tensors = load_file(key)
        self.mean, self.matrix = tensors["projection.mean_image"], tensors["projection.matrix_image"]
        count = sum(name.startswith("decoder.") for name in tensors) // 2
        self.layers = [(tensors[f"decoder.{at}.weight"].T, tensors[f"decoder.{at}.bias"]) for at in range(count)]

    def forward(self, features: torch.Tensor) -> torch.Tensor:
        """Logits of features."""
        x = (features - self.mean) @ self.matrix
        for at, layer in enumerate(self.layers):
            x = functional.linear(x if at == 0 else functional.gelu(x), *layer)
        return x
