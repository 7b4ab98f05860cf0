"""A scene of 100 MB through the page, and what the tab takes meanwhile. Takes minutes, so it runs when it is asked for:
`GUARDSPLAT_PAGE=large deploy/page.sh -k large`."""

from __future__ import annotations

import os
import re
import subprocess
import threading
import time
from pathlib import Path

import pytest
from conftest import sign_in
from playwright.sync_api import Page, expect
from service import Service, program

MOST = 1 << 30
LONG = 900_000


class Memory:
    """The most that any tab has had, by what was going on."""

    def __init__(self) -> None:
        self.phase = ""
        self.most: dict[str, int] = {}
        threading.Thread(target=self._watch, daemon=True).start()

    def _watch(self) -> None:
        while True:
            listed = subprocess.run(["ps", "-eo", "rss,args"], capture_output=True, text=True, check=False).stdout
            tabs = [int(line.split()[0]) << 10 for line in listed.splitlines() if "--type=renderer" in line]
            self.most[self.phase] = max([self.most.get(self.phase, 0), *tabs])
            time.sleep(0.2)


@pytest.mark.skipif(
    os.environ.get("GUARDSPLAT_PAGE") != "large",
    reason="takes minutes; GUARDSPLAT_PAGE=large",
)
def test_a_large_scene(service: Service, token: str, key: str, folder: Path, tab: Page) -> None:
    scene = folder / "large.ply"
    program("guardsplat-worker", "sample", scene, "--gaussians", 430_000, "--seed", 2)
    assert scene.stat().st_size > 100_000_000
    memory = Memory()
    sign_in(tab, f"http://127.0.0.1:{service.page}", token)
    tab.locator("#mark-file").set_input_files(scene)
    tab.locator("#mark-key").select_option(key)
    tab.locator("#mark-message").fill("c0ffee42")
    tab.locator("#mark-preset").select_option("draft")
    seconds = {}

    def phase(name: str) -> None:
        seconds[name] = time.monotonic()
        memory.phase = name

    phase("sending")
    tab.get_by_role("button", name="Mark the scene").click()
    expect(tab.locator("#mark-job")).to_contain_text(re.compile("Waiting|Preparing|Working"), timeout=LONG)
    phase("marking and fetching")
    result = tab.locator("#mark-result")
    turn = result.get_by_role("button", name="Turn it here")
    turn.wait_for(timeout=LONG)
    phase("showing")
    turn.click()
    result.get_by_role("button", name="Take a picture").click(timeout=LONG)
    result.get_by_role("button", name="Check it").wait_for(timeout=LONG)
    phase("end")
    names, times = list(seconds), list(seconds.values())
    for name, begun, ended in zip(names, times, times[1:], strict=False):
        print(f"{name}: {ended - begun:.0f} s, {memory.most[name] / (1 << 20):.0f} MiB at most")
    assert max(memory.most.values()) < MOST
