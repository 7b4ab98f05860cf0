"""What is told of marks and scenes, with the names of the worker's JSON."""

from __future__ import annotations

import json
from dataclasses import dataclass, fields
from typing import Any, TypeVar

_Report = TypeVar("_Report")


def report_of(kind: type[_Report], text: str) -> _Report:
    """A report from its JSON."""
    found = json.loads(text)
    return kind(**{field.name: found.get(field.name) for field in fields(kind)})  # type: ignore[arg-type]


@dataclass(frozen=True)
class EmbedReport:
    """What became of an embedding: means over held-out views of what was written, as 8-bit pictures."""

    bit_accuracy: float
    """Mean share of right bits of a view, 0 to 1."""
    bit_accuracy_worst_view: float
    """The same of the worst view."""
    message: str
    """The message as read from the first few views."""
    message_recovered: bool
    """Whether that is the message."""
    psnr_db: float | None
    """Mean PSNR in dB over views that differ; ``None`` where none does."""
    identical: bool
    """Whether the mark changes no pixel of any view."""
    identical_views: int
    """Views in which the mark changes no pixel."""
    ssim: float
    """Mean SSIM."""
    lpips: float | None
    """Mean LPIPS, where its weights were added."""
    psnr_covered_db: float | None
    """PSNR over the pixels that the scene covers."""
    covered: float
    """Mean share of a view that the scene covers."""
    steps: int
    """Steps taken."""
    view_steps: int
    """Views drawn in all steps."""
    seconds: float
    """How long it took."""
    device: str
    """Where it was computed."""
    clip: str
    """The key's CLIP."""
    preset: str
    """The preset."""
    bits: int
    """Bits of the message."""
    views: int
    """Views of the verification."""
    size: int
    """Their side in pixels."""
    gaussians: int
    """Gaussians of the scene."""
    seen_gaussians: int
    """Those that training views show."""
    changed_gaussians: int
    """Those whose colours changed."""
    ignored_rows: int
    """Rows of the file that were ignored."""
    covering_views: int
    """Training views that it took to find what can be seen."""
    predicted_memory_bytes: int
    """Memory that was predicted."""
    peak_memory_bytes: int | None
    """The most that the process has had in use so far."""
    written: bool
    """Whether the output was written, or handed out."""
    target_missed: list[str]
    """What misses the target, in words."""


@dataclass(frozen=True)
class Verdict:
    """Whether a message is there. ``bool(verdict)`` is whether it is a match."""

    verdict: str
    """``match``, ``no_match`` or ``inconclusive``."""
    p_value: float | None
    """Probability that bits match as well by chance."""
    threshold: float | None
    """A match needs a p-value at or below this."""
    matched_bits: int | None
    """Bits that match."""
    rank_sum: int | None
    """The sum of their ranks, of bits ranked by how clearly they were read."""
    needed_rank_sum: int | None
    """The rank sum that a match needs."""
    bits: int
    """Bits compared."""
    views: int
    """Views or pictures read."""
    message: str
    """The message read."""
    bit_accuracy: float | None
    """Mean share of bits of a view that match."""
    bit_accuracy_worst_view: float | None
    """The same of the worst view."""
    mean_abs_logit: float
    """Mean distance of the bits' logits from the threshold."""
    view_agreement: float
    """Mean share of views that agree with the decision on a bit."""
    framings: int
    """Ways in which pictures were looked at, each of which the p-value pays for."""
    framing: str | None
    """The way that agreed best, where it is not the first."""
    estimates: list[str] | None
    """What is estimated to have been done to each picture, where that was estimated."""
    explained_by_original: list[float | None] | None
    """Of each picture the share of it that the original explains, where it was compared with one; ``None`` where it does not
    show the original's scene."""
    ignored_rows: int
    """Rows of the scene that were ignored."""
    reason: str | None
    """Why nothing could be decided."""
    seconds: float
    """How long it took."""
    device: str
    """Where it was computed."""
    clip: str
    """The key's CLIP."""
    logits: list[list[float]] | None
    """Logits of every view, a number a bit, positive for 1, where they were asked for."""

    @property
    def is_match(self) -> bool:
        """Whether the message is there."""
        return self.verdict == "match"

    def __bool__(self) -> bool:
        return self.is_match

    def __str__(self) -> str:
        words = self.verdict.replace("_", " ")
        if self.p_value is None or self.threshold is None:
            return f"{words}: read {self.message}"
        return (
            f"{words}: {self.matched_bits} of {self.bits} bits, p = {self.p_value:.2e} (threshold {self.threshold:g})"
        )


@dataclass(frozen=True)
class Inspection:
    """What a scene file holds, and what marking it takes."""

    format: str
    """The file's format."""
    file_bytes: int
    """Its bytes, uncompressed."""
    gaussians: int
    """How many Gaussians."""
    ignored_rows: int
    """Rows that were ignored."""
    sh_degree_stored: int | None
    """Degree of spherical harmonics that the file has room for."""
    sh_degree_used: int
    """The degree in use."""
    sh_degree_learned: int
    """The degree up to which an embedding learns."""
    colours_rounded: bool
    """Whether the format rounds colours."""
    extent: dict[str, Any] | None
    """``centre``, ``radius``, ``up`` and ``on_ground``; ``None`` of nothing."""
    kind: dict[str, Any] | None
    """``found`` and ``used`` kind of scene, and the figures that say so."""
    difficulty: dict[str, Any] | None
    """What makes it hard to mark."""
    cameras: dict[str, Any] | None
    """``training`` and ``held_out`` cameras, and their ``clearance``, where cameras were given."""
    views: int | None
    """Training views that were looked at."""
    seen_gaussians: int | None
    """Gaussians that these show."""
    memory_limit_bytes: int
    """Memory that may be used."""
    render: dict[str, Any]
    """What rendering takes: ``bytes``, ``parts``, and whether it ``fits``."""
    embed: dict[str, Any] | None
    """The same of embedding with preset ``standard`` on the CPU."""
    forecast: dict[str, Any] | None
    """What to expect of a mark: ``bit_accuracy``, ``psnr_db``, ``psnr_covered_db``, ``seconds``, whether it
    ``meets_target``; and the same of a ``shorter`` message where it does not."""
