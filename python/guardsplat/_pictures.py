"""Pictures in memory: arrays ``[H, W, 3]`` of whatever library."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
import numpy.typing as npt

from .errors import BadOption

_INTEGERS = {np.dtype(np.uint8): 255, np.dtype(np.uint16): 65535}
# What is rendered overshoots 1 a little; what is beyond this is a picture of 0 to 255.
_MOST = 16.0
# As of picture files.
_PIXELS = 1 << 28

EnginePicture = tuple[int, int, bytes]


def array_of(value: Any) -> npt.NDArray[Any]:
    """A numpy array of what offers DLPack (torch, JAX, CuPy) or ``__array__``; sequences are none."""
    if isinstance(value, np.ndarray):
        return value
    if hasattr(value, "detach"):
        # A tensor of torch, which may be on a GPU, or be learned.
        value = value.detach().cpu()
        if str(value.dtype) == "torch.bfloat16":
            value = value.float()
    if hasattr(value, "__dlpack__"):
        try:
            return np.from_dlpack(value)
        except (BufferError, RuntimeError, TypeError, ValueError):
            # On another device, or of a kind that numpy does not take: asked for its own way below.
            pass
    return np.asarray(value)


def is_array(value: Any) -> bool:
    """Whether this is pixels rather than a path or a sequence of such."""
    if isinstance(value, (str, os.PathLike)):
        return False
    return hasattr(value, "__array__") or hasattr(value, "__dlpack__")


def _refuse(row: int, what: str, limit: str) -> BadOption:
    return BadOption(f"pictures: row {row} {what}, must be {limit}", field="pictures", row=row, limit=limit)


def pictures_of(value: Any, first: int, background: list[float]) -> list[EnginePicture]:
    """The pictures of an array: one of three axes, any number of four. ``first`` counts them in messages."""
    array = array_of(value)
    if array.ndim == 4:
        return [_picture(one, first + index, background) for index, one in enumerate(array)]
    return [_picture(array, first, background)]


def _picture(array: npt.NDArray[Any], row: int, background: list[float]) -> EnginePicture:
    shape = "[H, W, 3] or [H, W, 4]"
    if array.ndim != 3 or array.shape[2] not in (3, 4):
        hint = " (permute it: channels are last)" if array.ndim == 3 and array.shape[0] in (3, 4) else ""
        raise _refuse(row, f"has shape {list(array.shape)}{hint}", shape)
    height, width = array.shape[:2]
    if height * width == 0 or height * width > _PIXELS:
        raise _refuse(row, f"has {width} x {height} pixels", f"1 to {_PIXELS} pixels")
    most = _INTEGERS.get(array.dtype)
    if most is not None:
        pixels = array.astype(np.float32) / np.float32(most)
    elif array.dtype.kind == "f":
        pixels = array.astype(np.float32)
        _check_floats(pixels, row)
        # As a screen shows it, and a file of 8 bits holds it.
        pixels = np.clip(pixels, 0, 1)
    else:
        raise _refuse(row, f"is of {array.dtype}", "uint8, uint16 or floating point")
    if pixels.shape[2] == 4:
        alpha = pixels[..., 3:]
        pixels = pixels[..., :3] * alpha + np.asarray(background, dtype=np.float32) * (1 - alpha)
    return height, width, np.ascontiguousarray(pixels, dtype=np.float32).tobytes()


def _check_floats(pixels: npt.NDArray[np.float32], row: int) -> None:
    wrong = ~np.isfinite(pixels)
    if wrong.any():
        y, x, _ = np.argwhere(wrong)[0]
        raise _refuse(row, f"has a pixel ({x}, {y}) that is not finite", "finite")
    largest = float(np.abs(pixels).max())
    if largest > _MOST:
        raise _refuse(row, f"has values up to {largest:g}", "0 to 1; pictures of 0 to 255 are uint8")
