"""Checks of arguments that several functions take."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping
from typing import Any, Union

from . import _engine
from .errors import BadOption

KeyOrPath = Union[_engine.Key, str, "os.PathLike[str]"]
"""A key, or the file that it is in."""


def key_of(key: KeyOrPath) -> _engine.Key:
    """The key itself."""
    return key if isinstance(key, _engine.Key) else _engine.Key.load(os.fspath(key))


def message_of(message: str | bytes) -> str:
    """A message in hexadecimal."""
    if isinstance(message, (bytes, bytearray)):
        return message.hex()
    if isinstance(message, str):
        return message
    raise TypeError(f"message is a {type(message).__name__}, must be hexadecimal digits or bytes")


def within(field: str, value: Any, low: int, high: int) -> int:
    """A whole number from ``low`` to ``high``."""
    if isinstance(value, bool) or not hasattr(value, "__index__"):
        raise TypeError(f"{field} is {value!r}, must be a whole number")
    number = value.__index__()
    if low <= number <= high:
        return int(number)
    limit = f"{low} to {high}"
    raise BadOption(f"{field}: {number} is outside {limit}", field=field, limit=limit)


def seed_of(seed: int) -> int:
    """A seed of 64 bits."""
    return within("seed", seed, 0, 2**64 - 1)


def memory_of(mebibytes: int | None) -> int | None:
    """Bytes of memory."""
    return None if mebibytes is None else within("memory", mebibytes, 1, 1 << 24) << 20


def rgb_of(background: str | Iterable[float]) -> list[float]:
    """What is behind a scene."""
    if isinstance(background, str):
        named = {"white": [1.0, 1.0, 1.0], "black": [0.0, 0.0, 0.0]}
        if background in named:
            return named[background]
        message = f"background: {background!r} must be white, black or three numbers"
        raise BadOption(message, field="background", limit="white, black or three numbers")
    rgb = [float(value) for value in background]
    if len(rgb) == 3 and all(0 <= value <= 1 for value in rgb):
        return rgb
    raise BadOption(f"background: {rgb} must be three numbers of 0 to 1", field="background", limit="0 to 1")


def names_of(names: str | Iterable[str] | None) -> str | None:
    """Names with commas between them."""
    return names if names is None or isinstance(names, str) else ",".join(names)


def json_of(settings: str | Mapping[str, Any] | None) -> str | None:
    """Settings as JSON."""
    return settings if settings is None or isinstance(settings, str) else json.dumps(settings)
