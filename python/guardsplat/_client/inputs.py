"""What is handed in: files, folders of pictures, and artifacts that are there already."""

from __future__ import annotations

import os
import uuid
from pathlib import Path
from typing import Any

from ..errors import BadOption
from .specs import FileOrArtifact

_PICTURES = {".png", ".jpg", ".jpeg", ".webp"}


def is_name(collection: str, text: str) -> bool:
    """Whether this is the whole name of something in a collection, such as ``keys/{key}``."""
    before, _, identity = text.partition("/")
    if before != collection:
        return False
    try:
        uuid.UUID(identity)
    except ValueError:
        return False
    return True


def inputs_of(suspects: Any) -> list[FileOrArtifact]:
    """Files and artifacts; of folders the pictures, by name."""
    found: list[FileOrArtifact] = []
    for one in [suspects] if isinstance(suspects, (str, os.PathLike)) else suspects:
        if not isinstance(one, (str, os.PathLike)):
            raise TypeError(f"suspects: {type(one).__name__} is no path; guardsplat.verify reads arrays")
        path = Path(one)
        if not path.is_dir():
            found.append(one)
            continue
        pictures = sorted(entry for entry in path.iterdir() if entry.suffix.lower() in _PICTURES)
        if not pictures:
            raise BadOption(
                f"suspects: {path} is a folder without pictures", field="suspects", limit="png, jpg or webp"
            )
        found.extend(pictures)
    if not found:
        raise BadOption("suspects: there is none; give scenes or pictures", field="suspects", limit="one at least")
    return found
