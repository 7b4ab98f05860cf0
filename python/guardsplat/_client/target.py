"""How a server is reached: its address, TLS, and the token that it is shown."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import grpc

from ..errors import BadOption, FileError

_OPTIONS = [
    # Signs of life, so that a vanished server is noticed.
    ("grpc.keepalive_time_ms", 15_000),
    ("grpc.keepalive_timeout_ms", 15_000),
    ("grpc.initial_reconnect_backoff_ms", 200),
    # How long a connection may take to be made; the pauses between are those above and below.
    ("grpc.min_reconnect_backoff_ms", 10_000),
    ("grpc.max_reconnect_backoff_ms", 2_000),
    # Lists have many entries.
    ("grpc.max_receive_message_length", 64 << 20),
    # What is retried, and how long, is decided here.
    ("grpc.enable_retries", 0),
]


@dataclass(frozen=True)
class Target:
    """A server, and how it is to be reached."""

    url: str
    token: str | None
    ca: str | None
    certificate: str | None
    certificate_key: str | None

    @classmethod
    def of(
        cls,
        url: str | None,
        token: str | None,
        ca: str | os.PathLike[str] | None,
        certificate: str | os.PathLike[str] | None,
        certificate_key: str | os.PathLike[str] | None,
    ) -> Target:
        """What is given, else what the variables say that the client's program has, too."""
        variable = os.environ.get
        url = url or variable("GUARDSPLAT_SERVER") or "http://127.0.0.1:50051"
        token = token or (variable("GUARDSPLAT_TOKEN") or "").strip() or None
        if token is None and (file := variable("GUARDSPLAT_TOKEN_FILE")):
            token = _bytes(file).decode("utf-8", "replace").strip()
        if token is not None and not (token.isascii() and token.replace("_", "").isalnum()):
            raise BadOption("token: it is none: letters, digits and underscores were expected", field="token")
        paths = (
            ca or variable("GUARDSPLAT_CA"),
            certificate or variable("GUARDSPLAT_CERT"),
            certificate_key or variable("GUARDSPLAT_CERT_KEY"),
        )
        target = cls(url, token, *(None if path is None else os.fspath(path) for path in paths))
        target.place()
        return target

    def place(self) -> tuple[bool, str]:
        """Whether it is encrypted, and host and port."""
        scheme, separator, rest = self.url.partition("://")
        host = rest.rstrip("/")
        if not separator or scheme not in ("http", "https") or not host or any(c in host for c in " /"):
            message = f"url: {self.url!r} must be http://HOST:PORT or https://HOST:PORT"
            raise BadOption(message, field="url", limit="http://HOST:PORT or https://HOST:PORT")
        if scheme == "http" and (self.ca or self.certificate or self.certificate_key):
            raise BadOption("url: certificates are for TLS: begin the address with https://", field="url")
        if bool(self.certificate) != bool(self.certificate_key):
            raise BadOption("certificate: it and its key belong together", field="certificate")
        port = "" if ":" in host.rpartition("]")[2] else (":443" if scheme == "https" else ":80")
        return scheme == "https", host + port

    def channel(self, module: Any) -> Any:
        """A channel of ``grpc`` or ``grpc.aio``."""
        encrypted, place = self.place()
        if not encrypted:
            return module.insecure_channel(place, options=_OPTIONS)
        read = [None if path is None else _bytes(path) for path in (self.ca, self.certificate_key, self.certificate)]
        return module.secure_channel(place, grpc.ssl_channel_credentials(*read), options=_OPTIONS)

    def metadata(self) -> list[tuple[str, str]]:
        """What every call shows."""
        return [] if self.token is None else [("authorization", f"Bearer {self.token}")]


def _bytes(path: str) -> bytes:
    try:
        return Path(path).read_bytes()
    except OSError as error:
        raise FileError(str(error), path=path, errno=error.errno) from error
