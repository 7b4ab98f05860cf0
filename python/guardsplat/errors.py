"""What can go wrong: exceptions that name the field, the row and the limit, as far as these are known."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Any

_ROW = re.compile(r"\brow (\d+)\b")
_LIMIT = re.compile(r"(?:outside|must be|the limit(?: of [\w .]+?)? is|is not between|longer than) ([^;]+)")


class GuardSplatError(Exception):
    """Base of all errors of the package; its text says all there is to say.

    ``field`` is the argument, property or array that is wrong, ``row`` the row of it, ``limit`` what it may be and
    ``path`` the file, each ``None`` where there is none.
    """

    field: str | None
    row: int | None
    limit: str | None
    path: Path | None

    def __init__(
        self,
        message: str,
        *,
        field: str | None = None,
        row: int | None = None,
        limit: str | None = None,
        path: str | os.PathLike[str] | None = None,
    ) -> None:
        super().__init__(message)
        self.message = message
        self.field = field
        # The engine's texts always name them in these words.
        if row is None and (found := _ROW.search(message)):
            row = int(found[1])
        if limit is None and (found := _LIMIT.search(message)):
            limit = found[1].strip()
        self.row = row
        self.limit = limit
        self.path = None if path is None else Path(path)

    def __str__(self) -> str:
        return self.message

    def __reduce__(self) -> tuple[Any, ...]:
        return (_again, (type(self), self.message, self.__dict__.copy()))


def _again(kind: type[GuardSplatError], message: str, state: dict[str, Any]) -> GuardSplatError:
    error = kind(message)
    error.__dict__.update(state)
    return error


class BadOption(GuardSplatError, ValueError):
    """An argument, named by ``field``, has a value outside its ``limit``."""


class BadScene(GuardSplatError, ValueError):
    """The file at ``path`` is not a scene that can be read; ``row`` is the first Gaussian that is wrong."""


class BadCameras(GuardSplatError, ValueError):
    """The file at ``path`` does not hold cameras."""


class BadPicture(GuardSplatError, ValueError):
    """The file at ``path`` is not a picture that can be read."""


class BadKey(GuardSplatError, ValueError):
    """The key file at ``path`` is damaged, or belongs to another CLIP."""


class BadModel(GuardSplatError, ValueError):
    """Weights of a model do not fit."""


class FileError(GuardSplatError, OSError):
    """Reading or writing ``path`` failed; ``errno`` says why, where the system did."""

    def __init__(self, message: str, *, errno: int | None = None, **named: Any) -> None:
        super().__init__(message, **named)
        self.errno = errno


class DoesNotFit(GuardSplatError, MemoryError):
    """The work takes more memory than there is, or than was allowed."""


class DeviceError(GuardSplatError, RuntimeError):
    """The compute device is missing or failed."""


class NotFinite(GuardSplatError, ArithmeticError):
    """A term of the loss, named by ``field``, stopped being a number; nothing was written."""


class Stopped(GuardSplatError, RuntimeError):
    """The work was stopped before it was done; nothing was written."""


class TargetMissed(GuardSplatError, RuntimeError):
    """The mark missed its target, so it was not handed out; ``report`` has the figures. ``force=True`` hands it out."""

    report: Any

    def __init__(self, message: str, *, report: Any = None, **named: Any) -> None:
        super().__init__(message, **named)
        self.report = report


class ServiceError(GuardSplatError, RuntimeError):
    """A server refused a call.

    ``code`` is that of gRPC (``NOT_FOUND``), ``reason`` the server's for programs, ``field`` the first field of the request
    that is wrong, ``violations`` what is wrong with each, ``metadata`` figures that go with the reason, and ``retry_after`` seconds after which
    to try again, where the server says so.
    """

    code: str
    reason: str | None
    violations: dict[str, str]
    metadata: dict[str, str]
    retry_after: float | None

    def __init__(
        self,
        message: str,
        *,
        code: str = "UNKNOWN",
        reason: str | None = None,
        violations: dict[str, str] | None = None,
        metadata: dict[str, str] | None = None,
        retry_after: float | None = None,
        **named: Any,
    ) -> None:
        super().__init__(message, **named)
        self.code = code
        self.reason = reason
        self.violations = violations or {}
        self.metadata = metadata or {}
        self.retry_after = retry_after


class ServerLost(ServiceError, ConnectionError):
    """The server can't be reached, or was not for as long as it was waited for. Jobs go on without their client."""


class JobFailed(GuardSplatError, RuntimeError):
    """A job failed: ``job`` is its name and ``reason`` why, such as ``TARGET_MISSED`` or ``INVALID_INPUT``."""

    job: str
    reason: str

    def __init__(self, message: str, *, job: str = "", reason: str = "", **named: Any) -> None:
        super().__init__(message, **named)
        self.job = job
        self.reason = reason


class JobCancelled(GuardSplatError, RuntimeError):
    """A job, named by ``job``, was cancelled."""

    job: str

    def __init__(self, message: str, *, job: str = "", **named: Any) -> None:
        super().__init__(message, **named)
        self.job = job


class DamagedDownload(GuardSplatError, RuntimeError):
    """What arrived for ``path`` is not what was announced; nothing was written."""
