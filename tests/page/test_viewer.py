"""The viewer shows a scene of any format as it shows the PLY of it."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from conftest import sign_in
from playwright.sync_api import Page, expect
from scenes import glb_of_spz, in_colour, in_two_places, spz_4
from service import Service, program

# A job on two busy cores.
LONG = 240_000
DRAFT = "KHR_gaussian_splatting_compression_spz_2"
# Shows the chosen file and takes a picture, whose pixels stay in the tab.
SHOW = """async (name) => {
    const { show } = await import("/viewer.js");
    const box = document.querySelector("main").appendChild(document.createElement("div"));
    let close = () => {};
    try {
        const picture = await new Promise((resolve, reject) => {
            const file = document.getElementById("mark-file").files[0];
            show(box, file, resolve).then((closes) => {
                close = closes;
                box.querySelector("button:last-child").click();
            }, reject);
        });
        const bitmap = await createImageBitmap(picture);
        const context = new OffscreenCanvas(bitmap.width, bitmap.height).getContext("2d");
        context.drawImage(bitmap, 0, 0);
        (window.pictures ??= {})[name] = context.getImageData(0, 0, bitmap.width, bitmap.height).data;
    } finally {
        close();
        box.remove();
    }
}"""
# PSNR over the pixels that one of two pictures covers, and the share of them.
COMPARE = """([one, other]) => {
    const [a, b] = [window.pictures[one], window.pictures[other]];
    let [covered, squares] = [0, 0];
    for (let i = 0; i < a.length; i += 4) {
        if (Math.min(a[i], a[i + 1], a[i + 2], b[i], b[i + 1], b[i + 2]) === 255) continue;
        covered += 1;
        for (let j = i; j < i + 3; j++) squares += (a[j] - b[j]) ** 2;
    }
    return [10 * Math.log10((255 ** 2 * 3 * covered) / Math.max(squares, 1)), (4 * covered) / a.length];
}"""


class Viewer:
    """Pictures of scene files, from where the viewer looks first."""

    def __init__(self, tab: Page) -> None:
        self.tab = tab

    def show(self, file: Path) -> None:
        self.tab.locator("#mark-file").set_input_files(file)
        self.tab.evaluate(SHOW, file.name)

    def likeness(self, one: Path, other: Path) -> float:
        psnr, covered = self.tab.evaluate(COMPARE, [one.name, other.name])
        assert covered > 0.05, f"only {covered:.1%} of the picture shows anything"
        return psnr


@pytest.fixture
def viewer(service: Service, tab: Page) -> Viewer:
    tab.goto(f"http://127.0.0.1:{service.page}")
    return Viewer(tab)


@pytest.fixture(scope="session")
def converted(folder: Path, small: Path) -> dict[str, Path]:
    """The same scene in every format, by what it is."""
    files = {"ply": folder / "same.ply"}
    files["ply"].write_bytes(in_colour(small.read_bytes()))
    for name in ("glb", "gltf", "spz", "compressed.ply", "ksplat", "splat", "sog"):
        files[name] = folder / f"same.{name}"
        program("guardsplat-worker", "convert", files["ply"], files[name])

    def make(name: str, ending: str, content: bytes) -> None:
        files[name] = folder / f"{name.replace(' ', '-')}.{ending}"
        files[name].write_bytes(content)

    spz = files["spz"].read_bytes()
    make("spz 4", "spz", spz_4(spz))
    make("glb of spz", "glb", glb_of_spz(spz, DRAFT))
    make("glb of spz 4", "glb", glb_of_spz(spz_4(spz), DRAFT.removesuffix("_2")))
    make("two places", "glb", in_two_places(files["glb"].read_bytes()))
    return files


# What formats keep: glTF every number, to single precision, the others bytes. Without bands it is 36 dB at most.
@pytest.mark.parametrize(
    ("name", "reference", "least"),
    [
        ("glb", "ply", 50),
        ("gltf", "ply", 50),
        ("spz 4", "spz", 50),
        ("spz 4", "ply", 37),
        ("glb of spz", "spz", 50),
        ("glb of spz 4", "spz", 50),
        ("spz", "ply", 37),
        ("compressed.ply", "ply", 40),
        ("ksplat", "ply", 38),
        ("splat", "ply", 34),
        ("sog", "ply", 44),
    ],
)
def test_a_format_looks_as_another(
    viewer: Viewer, converted: dict[str, Path], name: str, reference: str, least: float
) -> None:
    viewer.show(converted[name])
    viewer.show(converted[reference])
    found = viewer.likeness(converted[name], converted[reference])
    print(f"{name} and {reference}: {found:.1f} dB")
    assert found >= least


def test_nodes_place_splats(viewer: Viewer, converted: dict[str, Path], folder: Path) -> None:
    # The reader of the workers puts all of them into one world.
    world = folder / "world.ply"
    program("guardsplat-worker", "convert", converted["two places"], world)
    for file in (converted["two places"], world, converted["ply"]):
        viewer.show(file)
    found = viewer.likeness(converted["two places"], world)
    print(f"two places: {found:.1f} dB")
    assert found >= 40
    # It sees differences.
    other = viewer.likeness(converted["ply"], world)
    print(f"another scene: {other:.1f} dB")
    assert other < 20
    seed = folder / "other.ply"
    program("guardsplat-worker", "sample", seed, "--gaussians", 8000, "--seed", 2)
    viewer.show(seed)
    other = viewer.likeness(converted["ply"], seed)
    print(f"another seed: {other:.1f} dB")
    assert other < 25


@pytest.mark.parametrize("name", ["glb", "spz 4"])
def test_what_is_damaged_is_told(viewer: Viewer, converted: dict[str, Path], folder: Path, name: str) -> None:
    whole = converted[name]
    damaged = folder / f"damaged{whole.suffix}"
    damaged.write_bytes(whole.read_bytes()[: whole.stat().st_size // 2])
    with pytest.raises(Exception, match="The viewer can't read this kind of file"):
        viewer.show(damaged)


@pytest.mark.parametrize("name", ["glb", "spz 4"])
def test_a_marked_scene_can_be_turned(
    service: Service, token: str, key: str, converted: dict[str, Path], tab: Page, name: str
) -> None:
    sign_in(tab, f"http://127.0.0.1:{service.page}", token)
    tab.locator("#mark-file").set_input_files(converted[name])
    tab.locator("#mark-key").select_option(key)
    tab.locator("#mark-message").fill("c0ffee42")
    tab.get_by_role("button", name="Mark the scene").click()
    result = tab.locator("#mark-result")
    result.get_by_role("button", name="Turn it here").click(timeout=LONG)
    result.get_by_role("button", name="Take a picture").click(timeout=LONG)
    result.get_by_role("button", name="Check it").click(timeout=LONG)
    expect(tab.locator("#verify-list")).to_contain_text("marked-1.png")
    tab.get_by_role("button", name="Verify").click()
    heading = tab.locator("#verify-result").get_by_role("heading", name=re.compile("The mark is there"))
    expect(heading).to_be_focused(timeout=LONG)
