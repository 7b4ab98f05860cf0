"""Gaussians in memory, in gsplat's layout of parameters."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _engine
from ._options import memory_of
from ._pictures import array_of
from .errors import BadOption

Splats = dict[str, npt.NDArray[np.float32]]
"""``means`` [N, 3], ``quats`` [N, 4] (w first), ``scales`` [N, 3] (logarithms), ``opacities`` [N] (logits), ``sh0``
[N, 1, 3] and ``shN`` [N, K - 1, 3]."""

_BANDS = (0, 3, 8, 15, 24)


def _refuse(field: str, what: str, limit: str, row: int | None = None) -> BadOption:
    return BadOption(f"{field}: {what}, must be {limit}", field=field, row=row, limit=limit)


def _array(field: str, value: Any, rest: tuple[int, ...], count: int | None) -> npt.NDArray[np.float32]:
    """An array of single precision of shape ``[count, *rest]``; any number in an axis of -1."""
    array = array_of(value)
    shape = "[" + ", ".join(["N" if count is None else str(count), *("K" if n < 0 else str(n) for n in rest)]) + "]"
    if array.dtype not in (np.dtype(np.float32), np.dtype(np.float64)):
        # Of half precision a mark would not be left.
        raise _refuse(field, f"is of {array.dtype}", "float32 or float64")
    fits = array.ndim == 1 + len(rest) and all(n in (-1, there) for n, there in zip(rest, array.shape[1:]))
    if not fits or (count is not None and array.shape[0] != count):
        raise _refuse(field, f"has shape {list(array.shape)}", shape)
    with np.errstate(over="ignore"):
        return np.ascontiguousarray(array, dtype=np.float32)


def _check(field: str, array: npt.NDArray[np.float32], wrong: npt.NDArray[np.bool_], limit: str) -> None:
    if wrong.any():
        at = tuple(np.argwhere(wrong)[0])
        raise _refuse(field, f"row {at[0]} has {array[at]}", limit, int(at[0]))


def to_engine(
    means: Any, quats: Any, scales: Any, opacities: Any, sh0: Any, shN: Any
) -> tuple[_engine.Arrays, npt.NDArray[np.float32]]:
    """The arrays as the engine takes them, every value checked, and all colours ``[N, K, 3]``."""
    positions = _array("means", means, (3,), None)
    count = positions.shape[0]
    if count == 0:
        raise _refuse("means", "there is none", "one at least")
    rotations = _array("quats", quats, (4,), count)
    deviations = _array("scales", scales, (3,), count)
    logits = array_of(opacities)
    if logits.ndim == 2 and logits.shape[1] == 1:
        logits = logits[:, 0]
    logits = _array("opacities", logits, (), count)
    constant = _array("sh0", sh0, (1, 3), count)
    others = np.zeros((count, 0, 3), np.float32) if shN is None else _array("shN", shN, (-1, 3), count)
    if others.shape[1] not in _BANDS:
        raise _refuse("shN", f"has {others.shape[1]} coefficients", "0, 3, 8, 15 or 24")
    for field, array in (("means", positions), ("quats", rotations), ("sh0", constant), ("shN", others)):
        _check(field, array, ~np.isfinite(array), "finite")
    _check("scales", deviations, np.isnan(deviations) | (deviations == np.inf), "less than infinity")
    _check("opacities", logits, np.isnan(logits), "a number")
    sh = np.concatenate([constant, others], axis=1)
    arrays: _engine.Arrays = {
        "means": positions.tobytes(),
        "quats": rotations.tobytes(),
        "scales": deviations.tobytes(),
        "opacities": logits.tobytes(),
        "sh": sh.tobytes(),
        "degree": _BANDS.index(others.shape[1]),
    }
    return arrays, sh


def like(array: npt.NDArray[np.float32], given: Any) -> Any:
    """The array as what was given: a tensor of torch on the same device, or a numpy array, of the same precision."""
    if hasattr(given, "detach"):
        import torch

        return torch.from_numpy(array).to(device=given.device, dtype=given.dtype)
    return array.astype(array_of(given).dtype, copy=False)


def load_gaussians(path: str | os.PathLike[str], *, ignore_bad_rows: bool = False, memory: int | None = None) -> Splats:
    """Reads a scene file of any format into arrays in gsplat's layout.

    Bands of spherical harmonics in which no Gaussian has anything but 0 are left out.
    """
    arrays, degree = _engine.load_gaussians(os.fspath(path), ignore_bad_rows, memory_of(memory))
    means, quats, scales, opacities, sh = (np.frombuffer(array, np.float32) for array in arrays)
    colours = sh.reshape(-1, (degree + 1) ** 2, 3)
    return {
        "means": means.reshape(-1, 3),
        "quats": quats.reshape(-1, 4),
        "scales": scales.reshape(-1, 3),
        "opacities": opacities,
        "sh0": colours[:, :1].copy(),
        "shN": colours[:, 1:].copy(),
    }


def save_gaussians(
    path: str | os.PathLike[str],
    *,
    means: Any,
    quats: Any,
    scales: Any,
    opacities: Any,
    sh0: Any,
    shN: Any = None,
) -> None:
    """Writes Gaussians in gsplat's layout as a scene file, of the format that the name says.

    ``.ply``, ``.compressed.ply``, ``.spz``, ``.sog``, ``.gltf``, ``.glb``, ``.ksplat`` or ``.splat``; PLY where it says none. All but
    PLY and glTF round colours: mark the file then, not the Gaussians.
    """
    arrays, _ = to_engine(means, quats, scales, opacities, sh0, shN)
    _engine.save_gaussians(os.fspath(path), arrays)
