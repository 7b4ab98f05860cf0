"""A marked scene from end to end: credentials by the worker, read by the C2PA's Python library, found again by the mark.

Run by deploy/credentials.sh, which says where the programs are.
"""

import json
import os
import shutil
import subprocess
from pathlib import Path

import c2pa
import pytest

PROGRAMS = Path(os.environ["GUARDSPLAT_PROGRAMS"])
MESSAGE = "c0ffee42"


def run(*words: object, code: int = 0) -> str:
    ran = subprocess.run(list(map(str, words)), capture_output=True, text=True, check=False)
    assert ran.returncode == code, ran.stdout + ran.stderr
    return ran.stdout


def worker(*words: object, code: int = 0) -> str:
    return run(PROGRAMS / "guardsplat-worker", *words, code=code)


def second_reader(scene: Path, sidecar: Path) -> dict:
    """What the C2PA's Python library says of a scene and its sidecar."""
    with scene.open("rb") as stream:
        reader = c2pa.Reader("application/octet-stream", stream, manifest_data=sidecar.read_bytes())
        told = json.loads(reader.json())
        told["state"] = reader.get_validation_state()
    return told


@pytest.fixture(scope="module")
def marked(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a key, a scene, its marked copy and the credentials of that."""
    folder = tmp_path_factory.mktemp("marked")
    worker("sample", folder / "scene.ply", "--gaussians", 6000, "--seed", 1)
    worker("key", "create", "--bits", 32, "--seed", 7, "-o", folder / "my.key", "--device", "cpu")
    store = folder / "store"
    store.mkdir()
    embed = ["embed", folder / "scene.ply", folder / "marked.ply", "--key", folder / "my.key", "--preset", "standard"]
    embed += ["--device", "cpu", "--force"]
    sidecar = store / "marked.c2pa"
    ran = subprocess.run(
        [PROGRAMS / "guardsplat-worker", *map(str, embed), "--message", MESSAGE, "--credentials", sidecar],
        capture_output=True,
        text=True,
        check=False,
    )
    assert ran.returncode in (0, 3), ran.stderr
    assert "test certificate" in ran.stderr
    return folder


def active(marked: Path) -> dict:
    """The active manifest, as the second reader tells it."""
    told = second_reader(marked / "marked.ply", marked / "store/marked.c2pa")
    return told["manifests"][told["active_manifest"]]


def test_a_second_reader_validates_it(marked: Path) -> None:
    told = second_reader(marked / "marked.ply", marked / "store/marked.c2pa")
    # Valid: hashes and signature are right; nobody trusts a test certificate.
    assert told["state"] == "Valid", told.get("validation_status")
    manifest = active(marked)
    assert manifest["claim_generator_info"][0]["name"] == "GuardSplat"
    assertions = {assertion["label"]: assertion["data"] for assertion in manifest["assertions"]}
    binding = assertions["c2pa.soft-binding"]
    assert binding["alg"] == "org.guardsplat.sh.1"
    actions = [action["action"] for action in assertions["c2pa.actions.v2"]["actions"]]
    assert actions == ["c2pa.opened", "c2pa.watermarked.bound"]
    assert manifest["title"] == "marked.ply"
    assert manifest["instance_id"].startswith("ni:///sha-256;")
    (original,) = manifest["ingredients"]
    assert original["title"] == "scene.ply"
    assert original["instance_id"].startswith("ni:///sha-256;")


def test_the_second_reader_notices_a_change(marked: Path) -> None:
    told = second_reader(marked / "scene.ply", marked / "store/marked.c2pa")
    assert told["state"] == "Invalid"
    assert "assertion.dataHash.mismatch" in json.dumps(told["validation_status"])


def test_the_worker_checks_it(marked: Path) -> None:
    sidecar = marked / "store/marked.c2pa"
    told = worker("credentials", "check", marked / "marked.ply", sidecar, code=3)
    assert "test certificate" in told
    worker("credentials", "check", marked / "scene.ply", sidecar, code=2)


def test_a_stripped_copy_is_found_by_its_mark_alone(marked: Path) -> None:
    """The copy is in another format, so that no hash would find it; pictures of it are found, too."""
    copy = marked / "copy.splat"
    worker("convert", marked / "marked.ply", copy)
    find = ["credentials", "find", "--key", marked / "my.key", "--store", marked / "store", "--device", "cpu"]
    # Others in the store: one that names the same message, and one that is no credentials.
    shutil.copy(marked / "store/marked.c2pa", marked / "store/same.c2pa")
    (marked / "store/none.c2pa").write_bytes(b"PK")
    told = json.loads(worker(*find, copy, "--json"))
    assert told["verdict"] == "match"
    assert told["credentials"].endswith("marked.c2pa")
    assert told["compared"] == 1
    # As a service that resolves soft bindings is asked.
    key = ["--key", marked / "my.key", "--device", "cpu"]
    asked = json.loads(worker("credentials", "value", copy, *key, "--json"))
    (binding,) = [a["data"] for a in active(marked)["assertions"] if a["label"] == "c2pa.soft-binding"]
    assert asked == {"alg": binding["alg"], "value": binding["blocks"][0]["value"]}
    worker("render", copy, marked / "views", "--views", 8, "--size", 400)
    told = json.loads(worker(*find, marked / "views", "--json"))
    assert told["verdict"] == "match"
    # The unmarked scene has none, and neither has a store that names no such key.
    worker(*find, marked / "scene.ply", code=2)
    empty = marked / "empty"
    empty.mkdir(exist_ok=True)
    find[5] = empty
    told = worker(*find, copy, code=2)
    assert "no credentials there name this key" in told


def test_what_cannot_be_signed_is_told_before_the_work(marked: Path) -> None:
    line = ["embed", marked / "scene.ply", marked / "no.gltf", "--key", marked / "my.key", "--message", MESSAGE]
    ran = subprocess.run(
        [PROGRAMS / "guardsplat-worker", *map(str, line), "--credentials", "no.c2pa"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert ran.returncode == 1
    assert "convert the scene to .glb" in ran.stderr
