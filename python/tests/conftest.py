"""A scene, a key and a mark that all tests share: real ones, small and by the quickest preset."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path
from typing import Any

import pytest

import guardsplat

MESSAGE = "c0ffee42"
# Where cargo puts the programs.
PROGRAMS = Path(os.environ.get("CARGO_TARGET_DIR", Path(__file__).parents[2] / "target")).resolve() / "release"
# What the programs would take for settings is not of the tests.
ENVIRONMENT = {name: value for name, value in os.environ.items() if not name.startswith("GUARDSPLAT_")}
# Quick, and to the byte what the same machine computes again. A draft may miss its target, which is not what is tested.
QUICK: dict[str, Any] = {"preset": "draft", "device": "cpu", "seed": 3, "force": True}


def worker(*arguments: object) -> subprocess.CompletedProcess[str]:
    """Runs the worker's program."""
    command = [str(PROGRAMS / "guardsplat-worker"), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False, env=ENVIRONMENT)


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("guardsplat")


@pytest.fixture(scope="session")
def scene(folder: Path) -> Path:
    path = folder / "scene.ply"
    guardsplat.sample(path, gaussians=8000, seed=1)
    return path


@pytest.fixture(scope="session")
def key(folder: Path) -> guardsplat.Key:
    return guardsplat.Key.create(bits=32, seed=7, device="cpu")


@pytest.fixture(scope="session")
def key_file(folder: Path, key: guardsplat.Key) -> Path:
    path = folder / "my.key"
    key.save(path)
    return path


@pytest.fixture(scope="session")
def told() -> list[guardsplat.Progress]:
    """What the embedding of `marked` told of its progress."""
    return []


@pytest.fixture(scope="session")
def report(folder: Path, scene: Path, key: guardsplat.Key, told: list[guardsplat.Progress]) -> guardsplat.EmbedReport:
    return guardsplat.embed(scene, folder / "marked.ply", key=key, message=MESSAGE, progress=told.append, **QUICK)


@pytest.fixture(scope="session")
def marked(folder: Path, report: guardsplat.EmbedReport) -> Path:
    assert report.written
    return folder / "marked.ply"
