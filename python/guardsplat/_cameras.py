"""Cameras in OpenCV's convention: x right, y down, z forward."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Union

import numpy as np
import numpy.typing as npt

from . import _engine
from .errors import BadOption


@dataclass(frozen=True, eq=False)
class Camera:
    """A pinhole camera, with matrices as gsplat takes them."""

    viewmat: npt.NDArray[np.float32]
    """World to camera, ``[4, 4]``."""
    K: npt.NDArray[np.float32]
    """Focal lengths and principal point in pixels, ``[3, 3]``."""
    width: int
    """Pixels a row."""
    height: int
    """Rows."""


CamerasFrom = Union[str, "os.PathLike[str]", Iterable[Camera], None]
"""A file (cameras.json, transforms.json or a glTF), a folder of COLMAP, cameras, or none."""


def from_numbers(numbers: _engine.CameraNumbers) -> Camera:
    width, height, (fx, fy, cx, cy), rotation, translation = numbers
    viewmat = np.eye(4, dtype=np.float32)
    viewmat[:3, :3] = rotation
    viewmat[:3, 3] = translation
    intrinsics = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]], dtype=np.float32)
    return Camera(viewmat, intrinsics, width, height)


def _matrix(value: Any, side: int, field: str, row: int) -> npt.NDArray[np.float32]:
    if hasattr(value, "detach"):
        value = value.detach().cpu()
    matrix = np.asarray(value, dtype=np.float32)
    if matrix.shape != (side, side):
        limit = f"[{side}, {side}]"
        message = f"cameras: {field} of row {row} has shape {list(matrix.shape)}, must be {limit}"
        raise BadOption(message, field=f"cameras.{field}", row=row, limit=limit)
    if not np.isfinite(matrix).all():
        message = f"cameras: {field} of row {row} has a number that is not finite"
        raise BadOption(message, field=f"cameras.{field}", row=row, limit="finite")
    return matrix


def _numbers(camera: Camera, row: int) -> _engine.CameraNumbers:
    if not isinstance(camera, Camera):
        message = f"cameras: row {row} is a {type(camera).__name__}, must be a guardsplat.Camera"
        raise BadOption(message, field="cameras", row=row, limit="guardsplat.Camera")
    view = _matrix(camera.viewmat, 4, "viewmat", row)
    k = _matrix(camera.K, 3, "K", row)
    for name, side in (("width", camera.width), ("height", camera.height)):
        if not 1 <= int(side) <= 16384:
            message = f"cameras: {name} of row {row} is {side}, must be 1 to 16384"
            raise BadOption(message, field=f"cameras.{name}", row=row, limit="1 to 16384")
    intrinsics = [float(k[0, 0]), float(k[1, 1]), float(k[0, 2]), float(k[1, 2])]
    return int(camera.width), int(camera.height), intrinsics, view[:3, :3].tolist(), view[:3, 3].tolist()


def to_engine(cameras: CamerasFrom) -> str | list[_engine.CameraNumbers] | None:
    """Cameras as the engine takes them."""
    if cameras is None:
        return None
    if isinstance(cameras, (str, os.PathLike)):
        return os.fspath(cameras)
    numbers = [_numbers(camera, row) for row, camera in enumerate(cameras)]
    if not numbers:
        raise BadOption("cameras: there is none, must be one at least", field="cameras", limit="one at least")
    return numbers


def read_cameras(path: str | os.PathLike[str]) -> list[Camera]:
    """Reads cameras of a file (``cameras.json`` of 3DGS, ``transforms.json`` of NeRF, a glTF) or a folder of COLMAP."""
    return [from_numbers(numbers) for numbers in _engine.read_cameras(os.fspath(path))]


def write_cameras(path: str | os.PathLike[str], cameras: Sequence[Camera]) -> None:
    """Writes ``cameras.json``, or ``transforms.json`` where the name has ``transforms`` in it."""
    _engine.write_cameras(os.fspath(path), [_numbers(camera, row) for row, camera in enumerate(cameras)])
