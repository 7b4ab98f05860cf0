"""What the engine's steps look at and find, as `bench_step` writes it."""

import json
from dataclasses import dataclass

import torch
from safetensors import safe_open


@dataclass(frozen=True)
class Camera:
    """A camera, and how a view of it is drawn."""

    width: int
    height: int
    focal: torch.Tensor  # [2], pixels
    principal: torch.Tensor  # [2]
    rotation: torch.Tensor  # [3, 3], world to camera
    translation: torch.Tensor  # [3]
    times: float  # the picture that the view stands for is so many times as large
    degree: int
    background: torch.Tensor  # [3]


@dataclass(frozen=True)
class Step:
    """A step's views, the first of which are fresh, and what the engine found."""

    views: list[int]
    reconstruction: float  # what terms that compare pictures are multiplied by
    ssim: float  # and SSIM besides
    rate: float
    found: torch.Tensor  # message, 1 - SSIM, L1


class Trace:
    """The file of a trace."""

    def __init__(self, path: str) -> None:
        with safe_open(path, "pt") as file:
            self.tensors = {name: file.get_tensor(name) for name in file.keys()}
            self.settings = json.loads(file.metadata()["settings"])
        self.cameras = [self._camera(at) for at in range(len(self.tensors["views.times"]))]
        rows = zip(*(self.tensors[f"steps.{name}"] for name in ("views", "factors", "found")))
        self.steps = [Step(views.tolist(), *factors.tolist(), found) for views, factors, found in rows]

    def _camera(self, at: int) -> Camera:
        of = {name: self.tensors[f"views.{name}"][at] for name in ("intrinsics", "rotations", "translations")}
        intrinsics = of["intrinsics"]
        return Camera(
            width=int(intrinsics[0]),
            height=int(intrinsics[1]),
            focal=intrinsics[2:4],
            principal=intrinsics[4:6],
            rotation=of["rotations"],
            translation=of["translations"],
            times=float(self.tensors["views.times"][at]),
            degree=int(self.tensors["views.degrees"][at]),
            background=self.tensors["views.backgrounds"][at],
        )
