"""Work that is ended: by Ctrl-C, or by who hears of its progress."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from conftest import MESSAGE

import guardsplat

# Whoever starts the tests may ignore Ctrl-C, as shells do for what they put into the background.
PROGRAM = """
import signal, sys, guardsplat
signal.signal(signal.SIGINT, signal.default_int_handler)
scene, out, key, what = sys.argv[1:]
def told(event):
    if event.stage == "optimising" and event.done == 3:
        print("going on", flush=True)
try:
    if what == "embed":
        guardsplat.embed(scene, out, key=key, message="c0ffee42", preset="thorough", device="cpu", progress=told)
    else:
        print("going on", flush=True)
        guardsplat.verify(scene, key=key, message="c0ffee42", device="cpu", views=10_000, size=512)
except KeyboardInterrupt:
    print("interrupted", flush=True)
"""


@pytest.mark.parametrize("what", ["embed", "verify"])
def test_ctrl_c_ends_a_job_and_leaves_nothing(what: str, scene: Path, key_file: Path, tmp_path: Path) -> None:
    command = [sys.executable, "-c", PROGRAM, str(scene), str(tmp_path / "out.ply"), str(key_file), what]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "going on\n"
        time.sleep(0.3)
        process.send_signal(signal.SIGINT)
        start = time.monotonic()
        assert process.stdout.readline() == "interrupted\n"
        assert process.wait(20) == 0
        # A step, or a view, is waited for and no more.
        assert time.monotonic() - start < 10
    assert list(tmp_path.iterdir()) == []


def test_an_exception_of_the_callback_ends_the_job_and_is_raised(
    scene: Path, key: guardsplat.Key, tmp_path: Path
) -> None:
    def told(event: guardsplat.Progress) -> None:
        if event.stage == "optimising":
            raise LookupError("enough")

    with pytest.raises(LookupError, match="enough"):
        guardsplat.embed(scene, tmp_path / "out.ply", key=key, message=MESSAGE, device="cpu", progress=told)
    with pytest.raises(LookupError, match="enough"):
        guardsplat.Key.create(bits=32, device="cpu", progress=told)
    assert list(tmp_path.iterdir()) == []


def test_a_bar_is_shown(scene: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("tqdm")
    guardsplat.render(scene, views=2, size=32, device="cpu", progress=True)
    assert "rendering: 100%" in capsys.readouterr().err
    with pytest.raises(TypeError, match="must be a callable"):
        guardsplat.render(scene, views=2, size=32, progress="yes")  # type: ignore[arg-type]
