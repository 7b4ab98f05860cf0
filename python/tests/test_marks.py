"""From a scene to a verdict, and the same bytes as the worker's."""

from __future__ import annotations

import json
import threading
from pathlib import Path

import numpy as np
import pytest
from conftest import MESSAGE, worker

import guardsplat


def test_a_rendered_picture_matches_and_another_key_or_message_does_not(
    marked: Path, scene: Path, key: guardsplat.Key
) -> None:
    pictures = guardsplat.render(marked, views=3, device="cpu")
    assert pictures.shape == (3, 512, 512, 3) and pictures.dtype == np.uint8
    verdict = guardsplat.verify(pictures, key=key, message=MESSAGE, device="cpu")
    assert verdict and verdict.verdict == "match" and verdict.views == 3
    assert str(verdict).startswith("match: ")
    assert verdict.p_value is not None and verdict.p_value <= 1e-6
    other = guardsplat.Key.create(bits=32, seed=8, device="cpu")
    assert guardsplat.verify(marked, key=other, message=MESSAGE, device="cpu").verdict == "no_match"
    assert guardsplat.verify(marked, key=key, message="0123abcd", device="cpu").verdict == "no_match"
    assert not guardsplat.verify(scene, key=key, message=MESSAGE, device="cpu")
    assert guardsplat.verify(marked, key=key, message=bytes.fromhex(MESSAGE), device="cpu").is_match
    # Without a message nothing is decided.
    read = guardsplat.verify(marked, key=key, device="cpu", views=2, logits=True)
    assert read.verdict == "inconclusive" and read.reason and len(read.message) == len(MESSAGE)
    assert read.logits is not None and np.shape(read.logits) == (2, 32)


def test_report_and_progress(report: guardsplat.EmbedReport, told: list[guardsplat.Progress]) -> None:
    assert report.bit_accuracy > 0.9 and report.bits == 32 and report.gaussians == 8000
    assert report.psnr_db is not None and report.psnr_db > 36 and report.preset == "draft" and report.device == "cpu"
    steps = [event for event in told if event.stage == "optimising"]
    assert [event.done for event in steps] == list(range(1, report.steps + 1))
    assert steps[-1].bit_accuracy is not None and steps[-1].psnr_db is not None
    assert [event.done for event in told if event.stage == "reading"][-1] == report.views


def test_the_bytes_are_the_workers(
    folder: Path, scene: Path, marked: Path, key_file: Path, report: guardsplat.EmbedReport
) -> None:
    made = worker("key", "create", "--bits", 32, "--seed", 7, "--device", "cpu", "-o", folder / "worker.key")
    assert made.returncode == 0, made.stderr
    assert (folder / "worker.key").read_bytes() == key_file.read_bytes()
    by_worker = folder / "by-worker.ply"
    options = ["--preset", "draft", "--device", "cpu", "--seed", 3, "--force", "--json"]
    run = worker("embed", scene, by_worker, "--key", key_file, "--message", MESSAGE, *options)
    assert run.returncode == 0, run.stderr
    assert by_worker.read_bytes() == marked.read_bytes()
    told = json.loads(run.stdout)
    for name in ("bit_accuracy", "psnr_db", "ssim", "steps", "message", "changed_gaussians"):
        assert told[name] == getattr(report, name), name
    read = worker("verify", marked, "--key", key_file, "--message", MESSAGE, "--device", "cpu", "--json")
    verdict = guardsplat.verify(marked, key=key_file, message=MESSAGE, device="cpu")
    told = json.loads(read.stdout)
    assert (told["p_value"], told["mean_abs_logit"]) == (verdict.p_value, verdict.mean_abs_logit)


def test_other_threads_run_meanwhile(folder: Path, scene: Path, key: guardsplat.Key) -> None:
    done = threading.Event()

    def mark() -> None:
        guardsplat.verify(scene, key=key, message=MESSAGE, views=40, device="cpu")
        done.set()

    thread = threading.Thread(target=mark)
    thread.start()
    turns = 0
    while not done.is_set():
        turns += 1
        done.wait(0.001)
    thread.join()
    assert turns > 20


def test_what_a_scene_holds(scene: Path, folder: Path) -> None:
    found = guardsplat.inspect(scene, views=4)
    assert (found.format, found.gaussians, found.sh_degree_used) == ("PLY", 8000, 3)
    assert found.kind is not None and found.kind["found"] == "object"
    assert found.embed is not None and found.embed["fits"] is True and found.seen_gaussians
    assert found.forecast is None
    guardsplat.sample(folder / "room.spz", kind="room", gaussians=2000, cameras=folder / "cameras.json")
    assert guardsplat.inspect(folder / "room.spz", cameras=folder / "cameras.json").cameras is not None


def test_what_a_mark_would_come_to(scene: Path, key: guardsplat.Key) -> None:
    told = guardsplat.inspect(scene, forecast="draft", key=key, device="cpu").forecast
    assert told is not None and told["bits"] == key.bits and told["preset"] == "draft"
    assert 0.6 < told["bit_accuracy"] <= 1 and told["seconds"] > 0
    of_message = guardsplat.inspect(scene, forecast="draft", key=key, message=bytes(4), device="cpu").forecast
    assert of_message is not None and 0.5 <= of_message["bit_accuracy"] <= 1
    with pytest.raises(guardsplat.GuardSplatError, match="32 bits"):
        guardsplat.inspect(scene, forecast="draft", key=key, message=bytes(5), device="cpu")
    with pytest.raises(guardsplat.BadOption, match="paper"):
        guardsplat.inspect(scene, forecast="paper", key=key, device="cpu")
    with pytest.raises(guardsplat.BadOption, match="forecast"):
        guardsplat.inspect(scene, key=key)


def test_cameras(scene: Path, folder: Path) -> None:
    pictures, cameras = guardsplat.render(scene, views=2, size=64, device="cpu", return_cameras=True)
    assert cameras[0].viewmat.shape == (4, 4) and cameras[0].K.shape == (3, 3)
    again = guardsplat.render(scene, cameras=cameras, device="cpu")
    assert np.array_equal(again, pictures)
    guardsplat.write_cameras(folder / "two.json", cameras)
    read = guardsplat.read_cameras(folder / "two.json")
    assert len(read) == 2 and np.allclose(read[1].viewmat, cameras[1].viewmat, atol=1e-5)
    wide = guardsplat.Camera(cameras[0].viewmat, cameras[0].K, 96, 64)
    several = guardsplat.render(scene, cameras=[cameras[0], wide], device="cpu", dtype=np.float32)
    assert [picture.shape for picture in several] == [(64, 64, 3), (64, 96, 3)]
    assert several[0].dtype == np.float32
    assert np.array_equal((several[0].clip(0, 1) * 255).round().astype(np.uint8), pictures[0])


def test_keys(folder: Path, key: guardsplat.Key, key_file: Path) -> None:
    assert (key.bits, len(key.id), key.clip) == (32, 32, "guardsplat-2")
    assert guardsplat.Key.load(key_file).id == key.id
    assert guardsplat.Key.from_bytes(key.to_bytes()).id == key.id
    assert key.id in repr(key)
    assert key_file.stat().st_mode & 0o077 == 0
    stages: list[str] = []
    other = guardsplat.Key.create(bits=8, device="cpu", progress=lambda event: stages.append(event.stage))
    assert other.id != key.id and {"preparing", "optimising"} <= set(stages)


@pytest.mark.parametrize("message", ["c0ffee4", "xyz", b"\0"])
def test_messages_have_the_keys_length(message: str | bytes, key: guardsplat.Key, scene: Path) -> None:
    with pytest.raises(guardsplat.BadOption) as caught:
        guardsplat.verify(scene, key=key, message=message)
    assert caught.value.field == "message"
