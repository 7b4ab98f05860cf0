"""Files that are sent in chunks, and files that appear whole or not at all."""

from __future__ import annotations

import hashlib
import os
import uuid
from collections.abc import Callable, Iterator
from pathlib import Path

from ..errors import DamagedDownload, FileError
from ..v1 import artifact_service_pb2 as artifacts

_CHUNK = 1 << 20


def _failed(path: str | os.PathLike[str]) -> Callable[[OSError], FileError]:
    return lambda error: FileError(f"{os.fspath(path)}: {error.strerror}", path=path, errno=error.errno)


def _chunks(source: str | os.PathLike[str] | bytes) -> Iterator[bytes]:
    if isinstance(source, (bytes, bytearray)):
        for start in range(0, len(source), _CHUNK):
            yield bytes(source[start : start + _CHUNK])
        return
    try:
        with open(source, "rb") as file:
            while chunk := file.read(_CHUNK):
                yield chunk
    except OSError as error:
        raise _failed(source)(error) from error


def metadata_of(source: str | os.PathLike[str] | bytes, display_name: str | None) -> artifacts.UploadMetadata:
    """What is announced of a file, or of bytes."""
    digest, size = hashlib.sha256(), 0
    for chunk in _chunks(source):
        digest.update(chunk)
        size += len(chunk)
    named = "" if isinstance(source, (bytes, bytearray)) else Path(source).name
    return artifacts.UploadMetadata(
        display_name=named if display_name is None else display_name, size_bytes=size, sha256=digest.hexdigest()
    )


def requests_of(
    source: str | os.PathLike[str] | bytes, metadata: artifacts.UploadMetadata
) -> Iterator[artifacts.UploadArtifactRequest]:
    """The messages of an upload."""
    yield artifacts.UploadArtifactRequest(metadata=metadata)
    for chunk in _chunks(source):
        yield artifacts.UploadArtifactRequest(chunk=chunk)


class Destination:
    """A file that appears whole or not at all."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._digest = hashlib.sha256()
        self._artifact: artifacts.Artifact | None = None
        self.written = 0
        if path.is_dir():
            raise FileError(f"{path}: a folder, not a file to write", path=path)
        self._aside = path.parent / f".guardsplat-{uuid.uuid4().hex}.part"
        try:
            self._file = open(self._aside, "xb")
        except OSError as error:
            raise _failed(path)(error) from error

    def announced(self, artifact: artifacts.Artifact) -> None:
        """What is coming, again where a connection was lost."""
        if self._artifact is not None and self._artifact.sha256 != artifact.sha256:
            raise self._damaged("the artifact is another one after the connection was lost")
        self._artifact = artifact

    def write(self, chunk: bytes) -> None:
        """The next bytes."""
        try:
            self._file.write(chunk)
        except OSError as error:
            raise _failed(self._path)(error) from error
        self._digest.update(chunk)
        self.written += len(chunk)

    def finish(self, artifact: artifacts.Artifact) -> None:
        """Gives the file its name, if it is what was announced."""
        if self.written != artifact.size_bytes:
            raise self._damaged(f"{self.written} bytes arrived, not {artifact.size_bytes}")
        if self._digest.hexdigest() != artifact.sha256:
            raise self._damaged(f"SHA-256 is {self._digest.hexdigest()}, not {artifact.sha256}")
        try:
            self._file.flush()
            os.fsync(self._file.fileno())
            os.replace(self._aside, self._path)
        except OSError as error:
            raise _failed(self._path)(error) from error

    def close(self) -> None:
        """Leaves nothing beside the file."""
        self._file.close()
        self._aside.unlink(missing_ok=True)

    def _damaged(self, reason: str) -> DamagedDownload:
        return DamagedDownload(f"{self._path}: {reason}", path=self._path)
