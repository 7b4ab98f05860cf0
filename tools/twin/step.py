"""Steps of an embedding: fresh views, pictures, the loss and its gradient, and preconditioned SGD."""

import time
from collections import Counter
from pathlib import Path

import torch
from torch.nn import functional

from .likeness import Likeness
from .reading import Reader, Tower
from .splat import Scene, View, draw, prepare
from .trace import Step, Trace

MEAN_SQUARE, FLOOR = 0.07957747, 1e-2


class Stages:
    """Adds the time of a step's stages to `milliseconds`."""

    def __init__(self, milliseconds: Counter[str]) -> None:
        self.milliseconds, self.clock = milliseconds, time.perf_counter()

    def lap(self, stage: str) -> None:
        """`stage` ends."""
        before, self.clock = self.clock, time.perf_counter()
        self.milliseconds[stage] += 1e3 * (self.clock - before)


class Loss(torch.nn.Module):
    """The loss of a step's pictures, and its terms."""

    def __init__(self, trace: Trace, key: Path, clip: Path) -> None:
        super().__init__()
        self.tower, self.reader = Tower(clip), Reader(key)
        self.likeness = Likeness(self.tower.side)
        self.weights, self.targets = trace.settings["lambda"], trace.tensors["targets"]
        if any(camera.width != self.tower.side for camera in trace.cameras):
            raise ValueError(f"only views of {self.tower.side} px are compared")

    def forward(self, original: torch.Tensor, pictures: torch.Tensor, factors: torch.Tensor):
        """The loss of `pictures` against those without a mark; message, 1 - SSIM and L1."""
        w, marked = self.weights, pictures.clamp(0, 1)
        l1, l2, ssim = self.likeness.terms(original.clamp(0, 1), marked)
        logits = self.reader(self.tower(marked)) / w["temperature"]
        targets = self.targets.expand(len(logits), -1)
        message = w["temperature"] * functional.binary_cross_entropy_with_logits(logits, targets)
        alike = w["l1"] * l1 + w["l2"] * l2 + w["ssim"] * factors[1] * ssim
        total = w["reconstruction"] * factors[0] * alike + w["message"] * message
        return total, torch.stack([message, ssim, l1]).detach()


class Embedding:
    """The offsets, and the views that were prepared so far."""

    def __init__(self, trace: Trace, loss) -> None:
        self.trace, self.loss, self.scene = trace, loss, Scene(trace)
        self.options, self.fresh = trace.settings["optimizer"], trace.settings["fresh_per_step"]
        rows, energies = trace.tensors["learned.rows"], trace.tensors["learned.energies"]
        # What is not learned has the last slot.
        self.slots = torch.full((len(self.scene.positions),), len(rows))
        self.slots[rows] = torch.arange(len(rows))
        self.inverse = 1 / energies.clamp(min=FLOOR * energies.mean())
        coefficients = (trace.settings["learned_degree"] + 1) ** 2
        self.offsets = torch.zeros(len(rows) + 1, coefficients, 3, requires_grad=True)
        self.velocity = torch.zeros(len(rows), coefficients, 3)
        self.running = self.largest = 0.0
        self.views: dict[int, tuple[View, torch.Tensor]] = {}
        self.milliseconds: Counter[str] = Counter()  # of all steps, by stage

    def prepare(self, view: int) -> None:
        """Prepares a view, and draws it without a mark."""
        prepared = prepare(self.scene, self.trace.cameras[view])
        self.views[view] = prepared, draw(prepared, self.scene, None, self.slots)

    def before(self, steps: list[Step]) -> None:
        """Prepares what these steps show and do not prepare themselves."""
        fresh = set()
        for step in steps:
            fresh.update(step.views[: self.fresh])
            for view in step.views[self.fresh :]:
                if view not in fresh and view not in self.views:
                    self.prepare(view)

    def take(self, step: Step) -> torch.Tensor:
        """One step; returns its message term, 1 - SSIM and L1."""
        clock = Stages(self.milliseconds)
        for view in step.views[: self.fresh]:
            self.prepare(view)
        clock.lap("prepare")
        views = [self.views[view] for view in step.views]
        pictures = torch.stack([draw(view, self.scene, self.offsets, self.slots) for view, _ in views])
        original = torch.stack([original for _, original in views])
        clock.lap("draw")
        leaf = pictures.detach().requires_grad_()
        total, terms = self.loss(original, leaf, torch.tensor([step.reconstruction, step.ssim]))
        total.backward()
        clock.lap("loss")
        pictures.backward(leaf.grad)
        clock.lap("backward")
        self._move(step.rate, leaf[0].numel())
        clock.lap("optimiser")
        return terms

    @torch.no_grad()
    def _move(self, rate: float, pixels: int) -> None:
        o, gradient = self.options, self.offsets.grad[:-1]
        gradient *= self.inverse[:, None, None]
        gradient[:, :1] *= o["dc"]
        gradient[:, 1:] *= o["rest"]
        self.velocity.mul_(o["momentum"]).add_(gradient, alpha=1 - o["momentum"])
        squares = self.velocity.square().sum((1, 2))
        energy = float((squares / self.inverse).sum()) * MEAN_SQUARE / pixels
        self.running = energy if self.largest == 0 else 0.9 * self.running + 0.1 * energy
        self.largest = max(self.largest, self.running)
        scale = rate * o["length"] / max(self.largest, energy) ** 0.5 if energy > 0 else 0.0
        self.offsets[:-1].sub_(self.velocity, alpha=scale)
        self.offsets.grad = None
