"""Reading marks."""

from __future__ import annotations

import os
from collections.abc import Iterable
from typing import Any

from . import _cameras, _engine
from ._cameras import CamerasFrom
from ._options import KeyOrPath, key_of, memory_of, message_of, rgb_of, seed_of, within
from ._pictures import EnginePicture, is_array, pictures_of
from ._progress import ProgressTo
from ._reports import Verdict, report_of
from .errors import BadOption

# As of files.
_MOST = 10_000


def _sorted_out(suspects: Any, background: list[float]) -> tuple[list[str], list[EnginePicture]]:
    """Paths and pictures of one suspect."""
    paths: list[str] = []
    pictures: list[EnginePicture] = []
    alone = isinstance(suspects, (str, os.PathLike)) or is_array(suspects)
    for suspect in [suspects] if alone else suspects:
        if isinstance(suspect, (str, os.PathLike)):
            paths.append(os.fspath(suspect))
        elif is_array(suspect):
            pictures.extend(pictures_of(suspect, len(pictures), background))
        else:
            raise TypeError(f"suspects: {type(suspect).__name__} is neither a path nor an array")
        if len(paths) + len(pictures) > _MOST:
            raise BadOption(f"suspects: more than {_MOST}", field="suspects", limit=str(_MOST))
    if not paths and not pictures:
        raise BadOption("suspects: there is none; give scenes or pictures", field="suspects", limit="one at least")
    return paths, pictures


def verify(
    suspects: Any,
    *,
    key: KeyOrPath,
    message: str | bytes | None = None,
    original: str | os.PathLike[str] | None = None,
    views: int = 20,
    size: int | None = None,
    background: str | Iterable[float] = "white",
    cameras: CamerasFrom = None,
    kind: str | None = None,
    seed: int = 0,
    device: str = "auto",
    clip: str | None = None,
    ignore_bad_rows: bool = False,
    memory: int | None = None,
    logits: bool = False,
    progress: ProgressTo = None,
) -> Verdict:
    """Says whether a message is in a scene, or in pictures of one.

    Args:
        suspects: a path, an array or any number of these, all of one suspect. Paths are of scenes, pictures and folders
            of pictures. Arrays are pictures ``[H, W, 3]`` or ``[N, H, W, 3]``, or with an alpha channel: uint8, uint16, or floating
            point of 0 to 1; of numpy, torch, or anything with ``__array__`` or DLPack.
        key: the key, or its file.
        message: what to compare with, in hexadecimal or as bytes. Without it nothing is decided.
        original: the unmarked scene, a path. Pictures that do not match as they are given are compared with it, so that
            neither what is behind the scene nor a filter matters.
        views: views that a scene is read from.
        size: their side in pixels; what the key's CLIP takes in unless given.
        background: ``white``, ``black`` or three numbers: what is behind a scene, or shows through transparent pixels.
        cameras: where a scene's viewers are, as :func:`embed` was told.
        kind: the kind of scene, found from it unless given.
        seed: decides the views of a scene.
        device: ``auto``, ``wgpu`` or ``cpu``.
        clip: a CLIP that was added, instead of the one that the key names.
        ignore_bad_rows: leaves out Gaussians with NaN instead of refusing the scene.
        memory: most mebibytes of memory that may be taken.
        logits: tells the logits of every view, too.
        progress: a callback that is given :class:`Progress`, or ``True`` for a bar.
    """
    rgb = rgb_of(background)
    options: _engine.VerifyOptions = {
        "views": within("views", views, 1, 10_000),
        "size": None if size is None else within("size", size, 16, 4096),
        "background": rgb,
        "original": None if original is None else os.fspath(original),
        "cameras": _cameras.to_engine(cameras),
        "kind": kind,
        "seed": seed_of(seed),
        "ignore_bad_rows": bool(ignore_bad_rows),
        "clip": clip,
        "device": device,
        "memory": memory_of(memory),
        "logits": bool(logits),
    }
    paths, pictures = _sorted_out(suspects, rgb)
    wanted = None if message is None else message_of(message)
    return report_of(Verdict, _engine.verify(paths, pictures, key_of(key), wanted, options, progress))
