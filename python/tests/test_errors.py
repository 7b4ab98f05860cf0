"""What goes wrong is told with field, row, limit and path."""

from __future__ import annotations

import errno
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import MESSAGE

import guardsplat


def test_options_have_their_names_and_limits(scene: Path, key: guardsplat.Key, tmp_path: Path) -> None:
    def wrong(**options: Any) -> guardsplat.BadOption:
        with pytest.raises(guardsplat.BadOption) as caught:
            guardsplat.embed(scene, tmp_path / "out.ply", key=key, message=MESSAGE, **options)
        return caught.value

    assert wrong(preset="fast").field == "preset"
    assert wrong(device="cuda").limit == "auto, wgpu or cpu"
    assert (wrong(seed=-1).field, wrong(seed=2**64).limit) == ("seed", "0 to 18446744073709551615")
    assert (wrong(size=5000).field, wrong(size=5000).limit) == ("size", "16 to 4096")
    assert wrong(kind="cave").field == "kind"
    assert wrong(robust_to=["jpeg", "rain"]).field == "robust_to"
    assert wrong(learn="all of it").field == "learn"
    assert (wrong(ring=99.0).field, wrong(ring=99.0).limit) == ("ring.elevation", "-80 to 80")
    assert (wrong(settings={"steps": 0}).field, wrong(settings={"steps": 0}).limit) == ("steps", "1 to 10000000")
    assert wrong(settings={"stepz": 1}).field == "settings"
    assert wrong(cameras=[]).field == "cameras"
    assert isinstance(wrong(seed=-1), ValueError)
    with pytest.raises(TypeError):
        guardsplat.embed(scene, tmp_path / "out.ply", key=key, message=MESSAGE, seed=1.5)  # type: ignore[arg-type]
    with pytest.raises(guardsplat.BadOption) as caught:
        guardsplat.Key.create(bits=151, device="cpu")
    assert (caught.value.field, caught.value.limit) == ("bits", "1 to 150")
    assert list(tmp_path.iterdir()) == []


def test_files_have_their_paths(scene: Path, key: guardsplat.Key, tmp_path: Path) -> None:
    missing = tmp_path / "none.ply"
    with pytest.raises(guardsplat.FileError) as gone:
        guardsplat.inspect(missing)
    assert gone.value.path == missing and gone.value.errno == errno.ENOENT
    with pytest.raises(OSError):
        guardsplat.Key.load(tmp_path / "none.key")
    bad = tmp_path / "bad.key"
    bad.write_bytes(b"no key")
    with pytest.raises(guardsplat.BadKey) as damaged:
        guardsplat.Key.load(bad)
    assert damaged.value.path == bad
    text = tmp_path / "text.ply"
    text.write_text("hello")
    with pytest.raises(guardsplat.BadScene) as none:
        guardsplat.embed(text, tmp_path / "out.ply", key=key, message=MESSAGE)
    assert none.value.path == text
    with pytest.raises(guardsplat.BadOption) as other_format:
        guardsplat.embed(scene, tmp_path / "out.spz", key=key, message=MESSAGE, preset="draft", device="cpu")
    assert other_format.value.field == "path_out"
    with pytest.raises(guardsplat.DoesNotFit):
        guardsplat.embed(scene, tmp_path / "out.ply", key=key, message=MESSAGE, memory=1)


def test_a_bad_row_is_named(scene: Path, tmp_path: Path) -> None:
    data = bytearray(scene.read_bytes())
    start = data.index(b"end_header\n") + len(b"end_header\n")
    row = (len(data) - start) // 8000
    data[start + 1234 * row : start + 1234 * row + 4] = np.float32(np.nan).tobytes()
    bad = tmp_path / "nan.ply"
    bad.write_bytes(data)
    with pytest.raises(guardsplat.BadScene) as caught:
        guardsplat.load_gaussians(bad)
    assert caught.value.row == 1234 and caught.value.path == bad
    assert len(guardsplat.load_gaussians(bad, ignore_bad_rows=True)["means"]) == 7999
    assert guardsplat.inspect(bad, ignore_bad_rows=True).ignored_rows == 1


def test_a_missed_target_is_an_error_with_the_report(scene: Path, key: guardsplat.Key, tmp_path: Path) -> None:
    out = tmp_path / "out.ply"
    few: dict[str, Any] = {"settings": {"steps": 1}, "preset": "draft", "device": "cpu"}
    with pytest.raises(guardsplat.TargetMissed) as caught:
        guardsplat.embed(scene, out, key=key, message=MESSAGE, **few)
    assert caught.value.report.target_missed and not caught.value.report.written and not out.exists()
    assert guardsplat.embed(scene, out, key=key, message=MESSAGE, force=True, **few).written and out.exists()


def test_errors_go_through_pickle() -> None:
    error = guardsplat.BadOption("seed: -1 is outside 0 to 9", field="seed", limit="0 to 9")
    again = pickle.loads(pickle.dumps(error))
    assert (type(again), str(again), again.field, again.limit) == (type(error), str(error), "seed", "0 to 9")
