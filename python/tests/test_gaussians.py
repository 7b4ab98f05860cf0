"""Gaussians in memory, in gsplat's layout."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import MESSAGE, QUICK

import guardsplat


@pytest.fixture(scope="module")
def splats(scene: Path) -> dict[str, Any]:
    return guardsplat.load_gaussians(scene)


@pytest.fixture(scope="module")
def in_memory(splats: dict[str, Any], key: guardsplat.Key) -> guardsplat.MarkedColours:
    return guardsplat.embed_gaussians(**splats, key=key, message=MESSAGE, **QUICK)


def test_arrays_are_those_of_the_file(splats: dict[str, Any], scene: Path, folder: Path) -> None:
    shapes = {name: array.shape for name, array in splats.items()}
    assert shapes == {
        "means": (8000, 3),
        "quats": (8000, 4),
        "scales": (8000, 3),
        "opacities": (8000,),
        "sh0": (8000, 1, 3),
        "shN": (8000, 15, 3),
    }
    guardsplat.save_gaussians(folder / "again.ply", **splats)
    assert (folder / "again.ply").read_bytes() == scene.read_bytes()


def test_marks_in_memory_are_those_of_the_file(
    in_memory: guardsplat.MarkedColours, marked: Path, splats: dict[str, Any], key: guardsplat.Key, folder: Path
) -> None:
    of_file = guardsplat.load_gaussians(marked)
    assert np.array_equal(in_memory.sh0, of_file["sh0"]) and np.array_equal(in_memory.shN, of_file["shN"])
    assert in_memory.report.bit_accuracy > 0.9 and in_memory.report.written
    splats = {**splats, "sh0": in_memory.sh0, "shN": in_memory.shN}
    guardsplat.save_gaussians(folder / "exported.ply", **splats)
    assert (folder / "exported.ply").read_bytes() == marked.read_bytes()
    pictures = guardsplat.render_gaussians(**splats, views=3, device="cpu")
    assert guardsplat.verify(pictures, key=key, message=MESSAGE, device="cpu")


def test_bands_that_hold_nothing_stay_empty_and_precision_is_kept(splats: dict[str, Any], key: guardsplat.Key) -> None:
    bands = {**splats, "shN": np.zeros((8000, 24, 3)), "opacities": splats["opacities"][:, None]}
    found = guardsplat.embed_gaussians(
        **bands, key=key, message=MESSAGE, settings={"steps": 2}, force=True, preset="draft", device="cpu"
    )
    assert found.shN.shape == (8000, 24, 3) and found.shN.dtype == np.float64 and not found.shN.any()
    assert found.sh0.dtype == np.float32 and not np.array_equal(found.sh0, splats["sh0"])
    without = {**bands, "shN": None}
    alone = guardsplat.embed_gaussians(
        **without, key=key, message=MESSAGE, settings={"steps": 2}, force=True, preset="draft", device="cpu"
    )
    assert alone.shN is None and np.array_equal(alone.sh0, found.sh0)


def test_tensors_come_back_as_tensors(splats: dict[str, Any], key: guardsplat.Key) -> None:
    torch = pytest.importorskip("torch")
    tensors = {name: torch.nn.Parameter(torch.from_numpy(array)) for name, array in splats.items()}
    found = guardsplat.embed_gaussians(
        **tensors, key=key, message=MESSAGE, settings={"steps": 2}, force=True, device="cpu"
    )
    assert isinstance(found.sh0, torch.Tensor) and found.shN.shape == tensors["shN"].shape


def changed(splats: dict[str, Any], name: str, row: int, value: float) -> dict[str, Any]:
    array = splats[name].copy()
    array[row] = value
    return {**splats, name: array}


@pytest.mark.parametrize(
    ("name", "value", "limit"),
    [
        ("means", np.nan, "finite"),
        ("quats", np.inf, "finite"),
        ("scales", np.inf, "less than infinity"),
        ("opacities", np.nan, "a number"),
        ("sh0", np.nan, "finite"),
        ("shN", -np.inf, "finite"),
    ],
)
def test_values_are_refused_with_row(
    name: str, value: float, limit: str, splats: dict[str, Any], key: guardsplat.Key
) -> None:
    with pytest.raises(guardsplat.BadOption) as caught:
        guardsplat.embed_gaussians(**changed(splats, name, 4321, value), key=key, message=MESSAGE)
    assert (caught.value.field, caught.value.row, caught.value.limit) == (name, 4321, limit)


@pytest.mark.parametrize(
    ("name", "array", "limit"),
    [
        ("means", np.zeros((8000, 4), np.float32), "[N, 3]"),
        ("means", np.zeros((0, 3), np.float32), "one at least"),
        ("quats", np.zeros((7999, 4), np.float32), "[8000, 4]"),
        ("sh0", np.zeros((8000, 3), np.float32), "[8000, 1, 3]"),
        ("shN", np.zeros((8000, 7, 3), np.float32), "0, 3, 8, 15 or 24"),
        ("scales", np.zeros((8000, 3), np.float16), "float32 or float64"),
    ],
)
def test_shapes_are_refused(name: str, array: Any, limit: str, splats: dict[str, Any], key: guardsplat.Key) -> None:
    with pytest.raises(guardsplat.BadOption) as caught:
        guardsplat.embed_gaussians(**{**splats, name: array}, key=key, message=MESSAGE)
    assert (caught.value.field, caught.value.limit) == (name, limit)
