"""Who hears of progress: a callback, or a bar."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol


@dataclass(frozen=True)
class Progress:
    """What is going on."""

    stage: str
    """``preparing``, ``optimising``, ``reading``, ``rendering`` or ``storing``."""
    done: int
    """Steps, views or pictures done in this stage."""
    total: int
    """Of so many; 0 where that is not known."""
    bit_accuracy: float | None = None
    """Share of right bits in the views of the last step, 0 to 1."""
    psnr_db: float | None = None
    """Mean PSNR of these views in dB; ``None`` while they are identical."""


ProgressTo = Callable[[Progress], object] | bool | None
"""A callback, which may raise to end the work; ``True`` for a bar (tqdm's where it is installed); or ``None``."""


class Listener(Protocol):
    """Hears of progress until it is closed."""

    def __call__(
        self, stage: str, done: int, total: int, bit_accuracy: float | None = None, psnr_db: float | None = None
    ) -> None: ...

    def close(self) -> None: ...


class _Callback:
    def __init__(self, callback: Callable[[Progress], object]) -> None:
        self._callback = callback

    def __call__(
        self, stage: str, done: int, total: int, bit_accuracy: float | None = None, psnr_db: float | None = None
    ) -> None:
        self._callback(Progress(stage, done, total, bit_accuracy, psnr_db))

    def close(self) -> None:
        pass


class _Silent:
    def __call__(
        self, stage: str, done: int, total: int, bit_accuracy: float | None = None, psnr_db: float | None = None
    ) -> None:
        pass

    def close(self) -> None:
        pass


def _figures(bit_accuracy: float | None, psnr_db: float | None) -> str:
    figures = []
    if bit_accuracy is not None:
        figures.append(f"bits {100 * bit_accuracy:.1f} %")
    if psnr_db is not None:
        figures.append(f"PSNR {psnr_db:.1f} dB")
    return ", ".join(figures)


class _Tqdm:
    """A bar for each stage."""

    def __init__(self, tqdm: Any) -> None:
        self._tqdm = tqdm
        self._bar: Any = None
        self._stage: str | None = None

    def __call__(
        self, stage: str, done: int, total: int, bit_accuracy: float | None = None, psnr_db: float | None = None
    ) -> None:
        if stage != self._stage:
            self.close()
            self._bar = self._tqdm(total=total or None, desc=stage)
            self._stage = stage
        self._bar.total = total or None
        self._bar.set_postfix_str(_figures(bit_accuracy, psnr_db), refresh=False)
        self._bar.update(done - self._bar.n)

    def close(self) -> None:
        if self._bar is not None:
            self._bar.close()


class _Lines:
    """A line now and then, where there is no tqdm."""

    def __init__(self) -> None:
        self._last = time.monotonic()

    def __call__(
        self, stage: str, done: int, total: int, bit_accuracy: float | None = None, psnr_db: float | None = None
    ) -> None:
        if time.monotonic() - self._last < 5 and done != total:
            return
        self._last = time.monotonic()
        print(f"{stage} {done}/{total} {_figures(bit_accuracy, psnr_db)}".rstrip(), file=sys.stderr)

    def close(self) -> None:
        pass


def listener(progress: ProgressTo) -> Listener:
    """What the engine and the client tell progress to."""
    if progress is None or progress is False:
        return _Silent()
    if progress is not True:
        if not callable(progress):
            raise TypeError(f"progress is {progress!r}, must be a callable, True or None")
        return _Callback(progress)
    try:
        from tqdm.auto import tqdm
    except ImportError:
        return _Lines()
    return _Tqdm(tqdm)
