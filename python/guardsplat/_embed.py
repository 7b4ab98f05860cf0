"""Marking scenes: files, and Gaussians in memory."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from . import _cameras, _engine, _splats
from ._cameras import CamerasFrom
from ._options import KeyOrPath, json_of, key_of, memory_of, message_of, names_of, seed_of, within
from ._progress import ProgressTo
from ._reports import EmbedReport, report_of
from .errors import TargetMissed


def _options(
    preset: str,
    seed: int,
    device: str,
    cameras: CamerasFrom,
    kind: str | None,
    size: int | None,
    robust_to: str | Iterable[str] | None,
    learn: str,
    ring: float | None,
    settings: str | Mapping[str, Any] | None,
    clip: str | None,
    force: bool,
    ignore_bad_rows: bool,
    memory: int | None,
) -> _engine.EmbedOptions:
    return {
        "preset": preset,
        "seed": seed_of(seed),
        "device": device,
        "cameras": _cameras.to_engine(cameras),
        "kind": kind,
        "size": None if size is None else within("size", size, 16, 4096),
        "robust_to": names_of(robust_to),
        "learn": learn,
        "ring": ring,
        "settings": json_of(settings),
        "clip": clip,
        "force": bool(force),
        "ignore_bad_rows": bool(ignore_bad_rows),
        "memory": memory_of(memory),
    }


def _handed_out(report: EmbedReport, force: bool) -> EmbedReport:
    if report.target_missed and not force:
        missed = ", ".join(report.target_missed)
        raise TargetMissed(f"target missed: {missed}; nothing was written", report=report)
    return report


def embed(
    path_in: str | os.PathLike[str],
    path_out: str | os.PathLike[str],
    *,
    key: KeyOrPath,
    message: str | bytes,
    preset: str = "standard",
    cameras: CamerasFrom = None,
    kind: str | None = None,
    seed: int = 0,
    device: str = "auto",
    size: int | None = None,
    robust_to: str | Iterable[str] | None = None,
    learn: str = "all",
    ring: float | None = None,
    settings: str | Mapping[str, Any] | None = None,
    clip: str | None = None,
    force: bool = False,
    ignore_bad_rows: bool = False,
    memory: int | None = None,
    progress: ProgressTo = None,
) -> EmbedReport:
    """Marks a scene file with a message, verifies the marked file and only then writes it.

    The bytes are those of ``guardsplat-worker embed`` with the same options on the same device.

    Args:
        path_in: the scene: PLY, compressed PLY, SPZ, SOG (also as a folder), glTF, .ksplat or .splat.
        path_out: where to write the marked scene, in the same format.
        key: the key, or its file.
        message: hexadecimal digits, or bytes, as many bits as the key has.
        preset: ``draft``, ``standard``, ``robust``, ``thorough`` or ``paper``.
        cameras: where the scene's viewers are: a file, a folder of COLMAP, or cameras.
        kind: ``object``, ``room``, ``terrain``, ``forward`` or ``unbounded``; found from the scene unless given.
        seed: decides views, backgrounds and augmentation.
        device: ``auto``, ``wgpu`` or ``cpu``.
        size: side of training views and of those of the verification, in pixels.
        robust_to: what the mark is trained to stand: names, ``all`` or ``none``.
        learn: which coefficients change: ``all``, ``dc`` or ``rest``.
        ring: trains on views on a circle at this elevation in degrees.
        settings: settings in place of the preset's, for experiments: a mapping or JSON.
        clip: a CLIP that was added, instead of the one that the key names.
        force: writes the scene even when it misses its target.
        ignore_bad_rows: leaves Gaussians with NaN alone instead of refusing the scene.
        memory: most mebibytes of memory that may be taken.
        progress: a callback that is given :class:`Progress`, or ``True`` for a bar.

    Raises:
        TargetMissed: the mark is weaker, or shows more, than the preset asks for; nothing was written.
        GuardSplatError: whatever else went wrong; nothing was written.
    """
    options = _options(
        preset,
        seed,
        device,
        cameras,
        kind,
        size,
        robust_to,
        learn,
        ring,
        settings,
        clip,
        force,
        ignore_bad_rows,
        memory,
    )
    text = _engine.embed(os.fspath(path_in), os.fspath(path_out), key_of(key), message_of(message), options, progress)
    return _handed_out(report_of(EmbedReport, text), force)


@dataclass(frozen=True)
class MarkedColours:
    """Colours of marked Gaussians, as what was given: numpy arrays, or tensors of torch on the same device."""

    sh0: Any
    """``[N, 1, 3]``"""
    shN: Any
    """``[N, K - 1, 3]``, ``None`` where none was given."""
    report: EmbedReport
    """What became of it."""


def embed_gaussians(
    *,
    means: Any,
    quats: Any,
    scales: Any,
    opacities: Any,
    sh0: Any,
    shN: Any = None,
    key: KeyOrPath,
    message: str | bytes,
    preset: str = "standard",
    cameras: CamerasFrom = None,
    kind: str | None = None,
    seed: int = 0,
    device: str = "auto",
    size: int | None = None,
    robust_to: str | Iterable[str] | None = None,
    learn: str = "all",
    ring: float | None = None,
    settings: str | Mapping[str, Any] | None = None,
    clip: str | None = None,
    force: bool = False,
    memory: int | None = None,
    progress: ProgressTo = None,
) -> MarkedColours:
    """Marks Gaussians in memory, in gsplat's layout of parameters; only their colours change.

    Arrays of numpy, tensors of torch or anything with ``__array__`` or DLPack, of single or double precision, as a
    training script keeps them (gsplat's ``splats``): ``scales`` are logarithms and ``opacities`` logits. A PLY that is
    written of them afterwards is marked; other formats round colours, so mark their files with :func:`embed`.

    Args:
        means: ``[N, 3]``.
        quats: ``[N, 4]``, w first, of any length.
        scales: ``[N, 3]``, natural logarithms.
        opacities: ``[N]``, logits.
        sh0: ``[N, 1, 3]``.
        shN: ``[N, K - 1, 3]``; ``None`` for degree 0.

    The others, and what is raised, are those of :func:`embed`.
    """
    options = _options(
        preset, seed, device, cameras, kind, size, robust_to, learn, ring, settings, clip, force, False, memory
    )
    arrays, sh = _splats.to_engine(means, quats, scales, opacities, sh0, shN)
    text, colours = _engine.embed_gaussians(arrays, key_of(key), message_of(message), options, progress)
    report = _handed_out(report_of(EmbedReport, text), force)
    marked = np.frombuffer(colours, np.float32).reshape(sh.shape)
    return MarkedColours(
        sh0=_splats.like(marked[:, :1].copy(), sh0),
        shN=None if shN is None else _splats.like(marked[:, 1:].copy(), shN),
        report=report,
    )
