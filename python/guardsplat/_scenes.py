"""Looking at scenes."""

from __future__ import annotations

import os
from collections.abc import Iterable
from typing import Any

import numpy as np

from . import _cameras, _engine, _splats
from ._cameras import Camera, CamerasFrom
from ._options import KeyOrPath, key_of, memory_of, message_of, rgb_of, seed_of, within
from ._progress import ProgressTo
from ._reports import Inspection, report_of
from .errors import BadOption


def inspect(
    path: str | os.PathLike[str],
    *,
    views: int | None = None,
    cameras: CamerasFrom = None,
    kind: str | None = None,
    ignore_bad_rows: bool = False,
    memory: int | None = None,
    forecast: str | None = None,
    key: KeyOrPath | None = None,
    bits: int = 32,
    message: str | bytes | None = None,
    device: str = "auto",
) -> Inspection:
    """Tells what a scene file holds, and whether marking it fits in memory.

    ``views`` counts the Gaussians that so many training views show, which takes a while.
    ``forecast`` is a preset for which a short trial, of an eighth of its steps, tells what a mark would come to: with
    ``key``, or with a key of ``bits`` that is made for it; on ``device``. A ``message`` is that of the later mark; any other
    is tried without one, of which scenes that are hard to mark read another share of the bits.
    """
    if forecast is None and key is not None:
        raise BadOption("key: a key is for a forecast, and none is asked for", field="key", limit="with forecast")
    trial: _engine.ForecastOptions | None = None
    if forecast is not None:
        of = None if key is None else key_of(key)
        trial = {
            "key": of,
            "bits": within("bits", bits, 1, 150),
            "message": None if message is None else message_of(message),
            "preset": forecast,
            "device": device,
        }
    views = None if views is None else within("views", views, 1, 1000)
    given = _cameras.to_engine(cameras)
    text = _engine.inspect(os.fspath(path), views, given, kind, bool(ignore_bad_rows), memory_of(memory), trial)
    return report_of(Inspection, text)


def sample(
    path: str | os.PathLike[str],
    *,
    kind: str = "object",
    gaussians: int = 30_000,
    sh_degree: int = 3,
    seed: int = 0,
    cameras: str | os.PathLike[str] | None = None,
) -> None:
    """Makes a small scene to try things with, of the format that the name says.

    ``cameras`` is a file for cameras of the viewers of a room, of terrain, of a stage (``forward``) or of an ``unbounded`` scene.
    """
    gaussians = within("gaussians", gaussians, 1, 10_000_000)
    degree = within("sh_degree", sh_degree, 0, 4)
    file = None if cameras is None else os.fspath(cameras)
    _engine.sample(os.fspath(path), kind, gaussians, degree, seed_of(seed), file)


def _options(
    views: int | None,
    cameras: CamerasFrom,
    size: int | None,
    kind: str | None,
    background: str | Iterable[float],
    seed: int,
    device: str,
    dtype: Any,
    ignore_bad_rows: bool,
    memory: int | None,
) -> tuple[_engine.RenderOptions, np.dtype[Any]]:
    kept = np.dtype(dtype)
    if kept not in (np.dtype(np.uint8), np.dtype(np.float32)):
        raise BadOption(f"dtype: {kept} must be uint8 or float32", field="dtype", limit="uint8 or float32")
    options: _engine.RenderOptions = {
        "views": None if views is None else within("views", views, 1, 100_000),
        "cameras": _cameras.to_engine(cameras),
        "kind": kind,
        "size": None if size is None else within("size", size, 1, 8192),
        "background": rgb_of(background),
        "seed": seed_of(seed),
        "ignore_bad_rows": bool(ignore_bad_rows),
        "device": device,
        "memory": memory_of(memory),
        "eight_bit": kept == np.dtype(np.uint8),
    }
    return options, kept


def _pictures(
    rendered: list[tuple[bytearray, _engine.CameraNumbers]], dtype: np.dtype[Any]
) -> tuple[Any, list[Camera]]:
    cameras = [_cameras.from_numbers(numbers) for _, numbers in rendered]
    pictures = [
        np.frombuffer(rows, dtype).reshape(camera.height, camera.width, 3)
        for (rows, _), camera in zip(rendered, cameras)
    ]
    # Cameras of a file may have pictures of several sizes.
    same = len({picture.shape for picture in pictures}) == 1
    return (np.stack(pictures) if same else pictures), cameras


def render(
    path: str | os.PathLike[str],
    *,
    views: int | None = None,
    cameras: CamerasFrom = None,
    size: int | None = None,
    kind: str | None = None,
    background: str | Iterable[float] = "white",
    seed: int = 0,
    device: str = "auto",
    dtype: Any = np.uint8,
    ignore_bad_rows: bool = False,
    memory: int | None = None,
    return_cameras: bool = False,
    progress: ProgressTo = None,
) -> Any:
    """Renders views of a scene file: an array ``[views, H, W, 3]``.

    Views are from where viewers of such a scene are, none of which an embedding trains on, or from ``cameras``; where
    these have pictures of several sizes, a list of arrays. ``size`` is the side in pixels, 512 unless given; of given
    cameras their longer side. ``dtype`` is uint8, or float32 of values as rendered. With ``return_cameras`` a pair of the
    pictures and their cameras.
    """
    options, kept = _options(views, cameras, size, kind, background, seed, device, dtype, ignore_bad_rows, memory)
    pictures, seen_by = _pictures(_engine.render(os.fspath(path), options, progress), kept)
    return (pictures, seen_by) if return_cameras else pictures


def render_gaussians(
    *,
    means: Any,
    quats: Any,
    scales: Any,
    opacities: Any,
    sh0: Any,
    shN: Any = None,
    views: int | None = None,
    cameras: CamerasFrom = None,
    size: int | None = None,
    kind: str | None = None,
    background: str | Iterable[float] = "white",
    seed: int = 0,
    device: str = "auto",
    dtype: Any = np.uint8,
    return_cameras: bool = False,
    progress: ProgressTo = None,
) -> Any:
    """Renders views of Gaussians in memory, in gsplat's layout, as :func:`render` does of files."""
    options, kept = _options(views, cameras, size, kind, background, seed, device, dtype, False, None)
    arrays, _ = _splats.to_engine(means, quats, scales, opacities, sh0, shN)
    pictures, seen_by = _pictures(_engine.render_gaussians(arrays, options, progress), kept)
    return (pictures, seen_by) if return_cameras else pictures
