"""How calls are made again where the server was lost, lists read, and files sent and fetched."""

from __future__ import annotations

import os
import time
from functools import partial
from pathlib import Path
from typing import Any

from google.protobuf.message import Message

from ..errors import ServerLost, ServiceError
from ..v1 import artifact_service_pb2 as artifacts
from .files import Destination, metadata_of, requests_of
from .wire import Call, Close, Open, Read, Sleep, Steps, Work

_PAGE = 1000
_FIRST_PAUSE = 0.25
_LONGEST_PAUSE = 10.0
# Bytes a second at which files come and go, at least.
_SLOWEST = 64 << 10


class Calls:
    """Calls of one server, which is waited for so many seconds when it is silent or lost."""

    def __init__(self, url: str, timeout: float) -> None:
        self.url = url
        self.timeout = timeout
        # A server that was never there is told at once: waiting would only hide a wrong address.
        self.was_there = False

    def patience(self) -> Patience:
        """Pauses before a lost server is tried again."""
        return Patience(self)

    def call(self, method: str, request: Message) -> Steps[Any]:
        """Calls the server, again if it is lost meanwhile: only for what may arrive twice."""
        patience = self.patience()
        while True:
            try:
                answer = yield Call(method, request, self.timeout)
                self.was_there = True
                return answer
            except ServiceError as error:
                yield patience.pause(error)

    def all(self, method: str, request: Any, entries: str, limit: int | None) -> Steps[list[Any]]:
        """All entries of a list, or so many of its first."""
        found: list[Any] = []
        while limit is None or len(found) < limit:
            request.page_size = _PAGE if limit is None else min(_PAGE, limit)
            page = yield from self.call(method, request)
            found.extend(getattr(page, entries))
            request.page_token = page.next_page_token
            if not page.next_page_token:
                break
        return found[:limit]

    def upload(
        self, source: str | os.PathLike[str] | bytes, display_name: str | None = None
    ) -> Steps[artifacts.Artifact]:
        """Sends a file, or bytes, from the beginning again if the connection is lost."""
        metadata = yield Work(lambda: metadata_of(source, display_name))
        patience = self.patience()
        while True:
            try:
                limit = self.timeout + metadata.size_bytes / _SLOWEST
                sent = yield Call("ArtifactService.UploadArtifact", requests_of(source, metadata), limit)
                self.was_there = True
                return sent
            except ServiceError as error:
                yield patience.pause(error)

    def discard(self, name: str) -> Steps[None]:
        """Deletes what was sent for nothing, as far as that works."""
        try:
            yield Call("ArtifactService.DeleteArtifact", artifacts.DeleteArtifactRequest(name=name), self.timeout)
        except ServiceError:
            # What led here is what the user has to hear of.
            pass

    def download(self, name: str, path: str | os.PathLike[str]) -> Steps[artifacts.Artifact]:
        """Fetches an artifact into a file, whole or not at all, and goes on where a connection was lost."""
        file = Destination(Path(path))
        try:
            patience = self.patience()
            while True:
                before = file.written
                try:
                    artifact = yield from self._fetch(name, file)
                    yield Work(partial(file.finish, artifact))
                    return artifact
                except ServiceError as error:
                    if file.written > before:
                        patience.heard()
                    yield patience.pause(error)
        finally:
            file.close()

    def _fetch(self, name: str, file: Destination) -> Steps[artifacts.Artifact]:
        """One stream, from where the file ends."""
        request = artifacts.DownloadArtifactRequest(name=name, offset=file.written)
        stream = yield Open("ArtifactService.DownloadArtifact", request, None)
        artifact: artifacts.Artifact | None = None
        try:
            while (message := (yield Read(stream))) is not None:
                self.was_there = True
                if message.HasField("artifact"):
                    artifact = message.artifact
                    file.announced(artifact)
                else:
                    file.write(message.chunk)
        finally:
            yield Close(stream)
        if artifact is None or file.written < artifact.size_bytes:
            raise ServiceError("the server ended the stream before the file", code="UNAVAILABLE")
        return artifact


class Patience:
    """Pauses that double, until nothing was heard for too long."""

    def __init__(self, calls: Calls) -> None:
        self._calls = calls
        self.heard()

    def heard(self) -> None:
        """All is well again."""
        self._since: float | None = None
        self._next = _FIRST_PAUSE

    def pause(self, error: ServiceError) -> Sleep:
        """The pause after this error; it is raised where trying again is no use."""
        if error.code != "UNAVAILABLE":
            raise error
        now = time.monotonic()
        since = self._since = now if self._since is None else self._since
        wait = max(self._next, error.retry_after or 0.0)
        if not self._calls.was_there or now - since + wait > self._calls.timeout:
            told = f"{self._calls.url} can't be reached: {error.message}"
            raise ServerLost(told, code=error.code, reason=error.reason, metadata=error.metadata) from error
        self._next = min(2 * self._next, _LONGEST_PAUSE)
        return Sleep(wait)
