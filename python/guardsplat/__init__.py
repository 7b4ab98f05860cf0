"""Marks 3D Gaussian Splatting scenes with a message, and reads it back from pictures of them.

    import guardsplat

    guardsplat.sample("scene.ply")
    key = guardsplat.Key.create(bits=32)
    guardsplat.embed("scene.ply", "marked.ply", key=key, message="c0ffee42", progress=True)
    pictures = guardsplat.render("marked.ply", views=3)
    print(guardsplat.verify(pictures, key=key, message="c0ffee42"))

Keys are secret: whoever has one can read, forge and remove its marks.
"""

from typing import TYPE_CHECKING, Any

from ._cameras import Camera, read_cameras, write_cameras
from ._embed import MarkedColours, embed, embed_gaussians
from ._engine import Key, __version__
from ._progress import Progress
from ._reports import EmbedReport, Inspection, Verdict
from ._scenes import inspect, render, render_gaussians, sample
from ._splats import load_gaussians, save_gaussians
from ._verify import verify
from .errors import (
    BadCameras,
    BadKey,
    BadModel,
    BadOption,
    BadPicture,
    BadScene,
    DamagedDownload,
    DeviceError,
    DoesNotFit,
    FileError,
    GuardSplatError,
    JobCancelled,
    JobFailed,
    NotFinite,
    ServerLost,
    ServiceError,
    Stopped,
    TargetMissed,
)

if TYPE_CHECKING:
    from ._client.aio import AsyncClient
    from ._client.client import Client


def __getattr__(name: str) -> Any:
    # The engine does without grpcio; clients are loaded when they are asked for.
    if name not in ("Client", "AsyncClient"):
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    try:
        from ._client.aio import AsyncClient
        from ._client.client import Client
    except ImportError as error:
        raise ImportError(f"{error}; pip install 'guardsplat[client]'", name=error.name) from error
    return Client if name == "Client" else AsyncClient


__all__ = [
    "AsyncClient",
    "BadCameras",
    "BadKey",
    "BadModel",
    "BadOption",
    "BadPicture",
    "BadScene",
    "Camera",
    "Client",
    "DamagedDownload",
    "DeviceError",
    "DoesNotFit",
    "EmbedReport",
    "FileError",
    "GuardSplatError",
    "Inspection",
    "JobCancelled",
    "JobFailed",
    "Key",
    "MarkedColours",
    "NotFinite",
    "Progress",
    "ServerLost",
    "ServiceError",
    "Stopped",
    "TargetMissed",
    "Verdict",
    "__version__",
    "embed",
    "embed_gaussians",
    "inspect",
    "load_gaussians",
    "read_cameras",
    "render",
    "render_gaussians",
    "sample",
    "save_gaussians",
    "verify",
    "write_cameras",
]
