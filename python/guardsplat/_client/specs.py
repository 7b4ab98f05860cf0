"""What jobs are told, from what users choose."""

from __future__ import annotations

import os
from collections.abc import Iterable
from typing import Any, TypedDict, Union

from .._options import message_of, names_of, seed_of, within
from .._progress import ProgressTo
from ..errors import BadOption
from ..v1 import job_pb2 as jobs

FileOrArtifact = Union[str, "os.PathLike[str]"]
"""A file to be sent, or ``artifacts/{artifact}``."""


class Submission(TypedDict, total=False):
    """What all jobs take."""

    display_name: str
    """What people call it."""
    priority: int
    """How urgent it is, -10 to 10."""
    request_id: str
    """A UUID that names this request: said again, even by another process, it is the same job."""


class Waiting(TypedDict, total=False):
    """How a job is waited for."""

    progress: ProgressTo
    """A callback that is given :class:`guardsplat.Progress`, or ``True`` for a bar."""
    cancel: bool
    """Cancels the job where the wait is interrupted; else it goes on."""


class Embed(Submission, total=False):
    """How to mark a scene."""

    key: str
    """Required. ``keys/{key}``, or what people call the key."""
    message: str | bytes
    """The message in hexadecimal, or bytes; this or ``asset``."""
    asset: str
    """``assets/{asset}``, whose word is embedded."""
    preset: str
    """``draft``, ``standard``, ``robust``, ``thorough`` or ``paper``."""
    seed: int
    """Decides views, backgrounds and augmentation."""
    size: int
    """Side of training views in pixels."""
    cameras: FileOrArtifact
    """Where the scene's viewers are: cameras.json, transforms.json or a glTF."""
    kind: str
    """``object``, ``room``, ``terrain``, ``forward`` or ``unbounded``."""
    robust_to: str | Iterable[str]
    """What the mark is trained to stand: names, or ``all``."""
    force: bool
    """Hands out a scene that misses its target all the same."""
    ignore_bad_rows: bool
    """Leaves rows with NaN alone."""
    credentials: bool
    """Has content credentials made; :meth:`download` fetches ``embed_result.credentials.artifact``."""


class Verify(Submission, total=False):
    """What to compare with, and how."""

    key: str
    """Required. ``keys/{key}``, or what people call the key."""
    message: str | bytes
    """A message to compare with; of ``message``, ``asset``, ``owner`` and ``search`` at most one."""
    asset: str
    """The claim that this asset's mark is there."""
    owner: str
    """The claim that the mark of one of this owner's assets is there: ``owners/{owner}``, or a name."""
    search: bool
    """Searches all assets of the key."""
    views: int
    """Views that a scene is read from."""
    size: int
    """Their side in pixels."""
    seed: int
    """Decides them."""
    cameras: FileOrArtifact
    """Where a scene's viewers are."""
    original: FileOrArtifact
    """The unmarked scene: pictures are compared with it besides."""
    kind: str
    """The kind of a scene."""
    ignore_bad_rows: bool
    """Leaves out rows with NaN."""


class EmbedAndWait(Embed, Waiting, total=False):
    """To mark a scene, and wait for it."""


class VerifyAndWait(Verify, Waiting, total=False):
    """To verify, and wait for it."""


class KeyAndWait(Submission, Waiting, total=False):
    """To make a key, and wait for it."""


OTHER_FILES = ("cameras", "original")
"""Files that options name; the fields of the specs are called the same."""

WAITING: frozenset[str] = Waiting.__optional_keys__


def known(options: dict[str, Any], kind: Any) -> None:
    """Refuses options that there are none of."""
    names = kind.__optional_keys__
    for name in options:
        if name not in names:
            raise TypeError(f"{name!r} is no option, must be of: {', '.join(sorted(names))}")
    if "key" in names and not options.get("key"):
        raise BadOption("key: must be given", field="key", limit="keys/{key} or a name")


def _of(field: str, enum: Any, prefix: str, name: str) -> Any:
    """The number of a name, as users write it."""
    words = "EIGHT_BIT" if name == "8bit" else name.replace("-", "_").upper()
    if words != "UNSPECIFIED" and prefix + words in enum.keys():
        return enum.Value(prefix + words)
    names = [key[len(prefix) :].lower().replace("_", "-") for key in enum.keys() if not key.endswith("UNSPECIFIED")]
    limit = ", ".join(names)
    raise BadOption(f"{field}: {name!r} must be of: {limit}", field=field, limit=limit)


def state_of(name: str) -> Any:
    """The state of jobs of this name."""
    return _of("states", jobs.Job.State, "STATE_", name)


def _kind(options: dict[str, Any]) -> Any:
    kind = options.get("kind")
    return 0 if kind is None else _of("kind", jobs.EmbedSpec.SceneKind, "SCENE_KIND_", kind)


def _distortions(names: str | Iterable[str] | None) -> list[Any]:
    enum = jobs.EmbedSpec.Distortion
    text = names_of(names)
    if text is None:
        return []
    if text == "all":
        return [number for number in enum.values() if number != 0]
    return [_of("robust_to", enum, "DISTORTION_", name.strip()) for name in text.split(",")]


def _size(options: dict[str, Any]) -> int:
    size = options.get("size")
    return 0 if size is None else within("size", size, 16, 4096)


def embed_spec(scene: str, key: str, files: dict[str, str], options: dict[str, Any]) -> jobs.EmbedSpec:
    """The spec of an ``embed`` job; `files` are those of :data:`OTHER_FILES` that were sent."""
    message = options.get("message")
    return jobs.EmbedSpec(
        scene=scene,
        key=key,
        **files,
        message="" if message is None else message_of(message),
        asset=options.get("asset") or "",
        preset=_of("preset", jobs.EmbedSpec.Preset, "PRESET_", options.get("preset", "standard")),
        seed=seed_of(options.get("seed", 0)),
        size=_size(options),
        scene_kind=_kind(options),
        robust_to=_distortions(options.get("robust_to")),
        force=bool(options.get("force")),
        ignore_bad_rows=bool(options.get("ignore_bad_rows")),
        credentials=bool(options.get("credentials")),
    )


def verify_spec(suspects: list[str], key: str, files: dict[str, str], options: dict[str, Any]) -> jobs.VerifySpec:
    """The spec of a ``verify`` job; `files` are those of :data:`OTHER_FILES` that were sent."""
    message = options.get("message")
    return jobs.VerifySpec(
        suspects=suspects,
        key=key,
        **files,
        message="" if message is None else message_of(message),
        asset=options.get("asset") or "",
        owner=options.get("owner") or "",
        search=bool(options.get("search")),
        views=within("views", options.get("views", 20), 1, 10_000),
        size=_size(options),
        seed=seed_of(options.get("seed", 0)),
        scene_kind=_kind(options),
        ignore_bad_rows=bool(options.get("ignore_bad_rows")),
    )


def key_spec(bits: int, seed: int | None) -> jobs.KeySpec:
    """The spec of a ``create_key`` job."""
    bits = within("bits", bits, 1, 150)
    return jobs.KeySpec(bits=bits) if seed is None else jobs.KeySpec(bits=bits, seed=seed_of(seed))
