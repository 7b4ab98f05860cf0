"""Pictures of every kind of array, which read as files of the same pixels do."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import MESSAGE, worker

import guardsplat


@pytest.fixture(scope="module")
def pictures(marked: Path) -> Any:
    return guardsplat.render(marked, views=2, size=256, device="cpu")


def read(pictures: Any, key: guardsplat.Key, **options: Any) -> guardsplat.Verdict:
    return guardsplat.verify(pictures, key=key, message=MESSAGE, device="cpu", **options)


class Dlpack:
    """An array of another library, on the CPU."""

    def __init__(self, array: Any) -> None:
        self.array = array

    def __dlpack__(self, **arguments: Any) -> Any:
        return self.array.__dlpack__(**arguments)

    def __dlpack_device__(self) -> Any:
        return self.array.__dlpack_device__()


class Protocol:
    """An object with `__array__` alone."""

    def __init__(self, array: Any) -> None:
        self.array = array

    def __array__(self, dtype: Any = None, copy: Any = None) -> Any:
        return self.array if dtype is None else self.array.astype(dtype)


def test_arrays_read_as_files(pictures: Any, marked: Path, key: guardsplat.Key, folder: Path) -> None:
    rendered = folder / "views"
    assert worker("render", marked, rendered, "--views", 2, "--size", 256, "--device", "cpu").returncode == 0
    of_files = read(rendered, key, logits=True)
    of_arrays = read(pictures, key, logits=True)
    assert of_files.logits == of_arrays.logits
    together = read([rendered / "view_000.png", pictures[1]], key, logits=True)
    assert together.logits == of_files.logits


@pytest.mark.parametrize(
    "made",
    [
        lambda p: list(p),
        lambda p: p.astype(np.uint16) * 257,
        lambda p: p / np.float32(255),
        lambda p: p / 255,
        lambda p: (p / 255).astype(np.float16),
        lambda p: np.concatenate([p, np.full_like(p[..., :1], 255)], axis=-1),
        lambda p: p[:, :, ::-1][:, :, ::-1],
        lambda p: p.astype(">f4") / 255,
        lambda p: Dlpack(p),
        lambda p: Protocol(p),
    ],
    ids=["list", "uint16", "float32", "float64", "float16", "alpha", "strided", "big endian", "dlpack", "__array__"],
)
def test_every_kind_of_array(made: Any, pictures: Any, key: guardsplat.Key) -> None:
    plain = read(pictures, key)
    verdict = read(made(pictures), key)
    assert verdict and verdict.views == 2
    assert verdict.mean_abs_logit == pytest.approx(plain.mean_abs_logit, rel=0.05)


def test_tensors(pictures: Any, key: guardsplat.Key) -> None:
    torch = pytest.importorskip("torch")
    plain = read(pictures, key)
    for tensor in (torch.from_numpy(pictures), torch.from_numpy(pictures / 255).requires_grad_()):
        assert read(tensor, key).mean_abs_logit == pytest.approx(plain.mean_abs_logit, rel=1e-3)
    assert read(torch.from_numpy(pictures / 255).bfloat16(), key).views == 2


@pytest.mark.parametrize(
    ("wrong", "limit"),
    [
        (np.zeros((3, 64, 64)), "[H, W, 3] or [H, W, 4]"),
        (np.zeros((64, 64)), "[H, W, 3] or [H, W, 4]"),
        (np.zeros((64, 64, 3), np.int64), "uint8, uint16 or floating point"),
        (np.full((64, 64, 3), np.nan), "finite"),
        (np.full((64, 64, 3), 200.0), "0 to 1"),
        (np.zeros((0, 64, 3)), "pixels"),
    ],
    ids=["channels first", "grey", "int64", "nan", "0 to 255", "empty"],
)
def test_other_arrays_are_refused_with_row_and_limit(
    wrong: Any, limit: str, pictures: Any, key: guardsplat.Key
) -> None:
    with pytest.raises(guardsplat.BadOption) as caught:
        read([pictures[0], wrong], key)
    error = caught.value
    assert (error.field, error.row) == ("pictures", 1) and error.limit is not None and limit in error.limit


def test_a_picture_with_a_filter_is_compared_with_the_original(
    pictures: Any, scene: Path, key: guardsplat.Key, folder: Path
) -> None:
    # One picture, since those of one scene would be guessed together.
    filtered = (0.05 + 0.9 * (pictures[0] / 255.0) ** np.array([0.8, 1.0, 1.2])).astype(np.float32)
    blind = read(filtered, key)
    found = read(filtered, key, original=scene)
    assert blind.explained_by_original is None
    assert found.explained_by_original is not None and (found.explained_by_original[0] or 0) > 0.9
    assert (found.matched_bits or 0) > (blind.matched_bits or 0), (found, blind)
    with pytest.raises(guardsplat.GuardSplatError, match="nothing"):
        read(filtered, key, original=folder / "nothing.ply")


def test_nothing_and_things_that_are_no_suspects(key: guardsplat.Key) -> None:
    with pytest.raises(guardsplat.BadOption, match="there is none"):
        read([], key)
    with pytest.raises(TypeError, match="neither a path nor an array"):
        read([7], key)
