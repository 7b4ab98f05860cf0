"""Marks 3D Gaussian Splatting scenes with a message, and reads it back from pictures of them.

    import guardsplat

    guardsplat.sample("scene.ply")
    key = guardsplat.Key.create(bits=32)
    guardsplat.embed("scene.ply", "marked.ply", key=key, message="c0ffee42", progress=True)
    pictures = guardsplat.render("marked.ply", views=3)
    print(guardsplat.verify(pictures, key=key, message="c0ffee42"))

Keys are secret: whoever has one can read, forge and remove its marks.
"""

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
    DeviceError,
    DoesNotFit,
    FileError,
    GuardSplatError,
    NotFinite,
    Stopped,
    TargetMissed,
)

__all__ = [
    "BadCameras",
    "BadKey",
    "BadModel",
    "BadOption",
    "BadPicture",
    "BadScene",
    "Camera",
    "DeviceError",
    "DoesNotFit",
    "EmbedReport",
    "FileError",
    "GuardSplatError",
    "Inspection",
    "Key",
    "MarkedColours",
    "NotFinite",
    "Progress",
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
