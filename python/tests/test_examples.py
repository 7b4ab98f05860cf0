"""The examples run, and say what they promise; so do the first lines of docs/python.md."""

from __future__ import annotations

import runpy
from pathlib import Path

import pytest

PYTHON = Path(__file__).parents[1]


@pytest.fixture(autouse=True)
def _in_a_folder_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "Agg")


def first_lines(page: Path) -> str:
    """The first block of code of a page."""
    lines = page.read_text(encoding="utf-8").splitlines()
    start = next(i for i, line in enumerate(lines) if line.startswith("    "))
    block = []
    for line in lines[start:]:
        if line and not line.startswith("    "):
            break
        block.append(line[4:])
    return "\n".join(block)


def test_the_first_lines_of_the_page(capsys: pytest.CaptureFixture[str]) -> None:
    code = first_lines(PYTHON.parent / "docs/python.md")
    assert len([line for line in code.splitlines() if line]) <= 8
    # The same lines are shown where the package is.
    assert first_lines(PYTHON / "README.md") == code
    # A key of its own might be one of the few that miss the target.
    exec(compile(code.replace("bits=32", "bits=32, seed=7"), "docs/python.md", "exec"), {})
    assert capsys.readouterr().out.startswith("match: ")


def test_from_a_sample_to_a_verdict(capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("matplotlib")
    runpy.run_path(str(PYTHON / "examples/sample_to_verdict.py"))
    said = capsys.readouterr().out
    assert "marked:   match: " in said and "unmarked: no match: " in said and "other key: no match: " in said
    assert Path("learning.png").stat().st_size > 0 and Path("comparison.png").stat().st_size > 0


def test_a_training_script(capsys: pytest.CaptureFixture[str]) -> None:
    runpy.run_path(str(PYTHON / "examples/training_script.py"))
    assert capsys.readouterr().out.splitlines()[-1].startswith("match: ")
