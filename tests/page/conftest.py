"""A browser, a server, a scene and a key that the tests share."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Locator, Page, sync_playwright
from service import Service, program

CHROMIUM = os.environ.get("GUARDSPLAT_CHROMIUM", "/usr/bin/chromium")
# No GPU is needed; root's browser has no sandbox of its own.
FLAGS = [
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--no-sandbox",
    "--disable-dev-shm-usage",
]


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        yield browser
        browser.close()


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("page")


@pytest.fixture(scope="session")
def service(folder: Path) -> Iterator[Service]:
    service = Service(folder / "data")
    yield service
    service.stop()


@pytest.fixture(scope="session")
def token(service: Service) -> str:
    return service.token()


@pytest.fixture(scope="session")
def key(service: Service, token: str) -> str:
    """A key that marks the scene well, always the same one."""
    service.client(token, "key", "create", "--bits", 32, "--display-name", "studio", "--seed", 7)
    return "studio (32 bits)"


@pytest.fixture(scope="session")
def scene(folder: Path) -> Path:
    path = folder / "sample.ply"
    program("guardsplat-worker", "sample", path, "--gaussians", 20000, "--seed", 1)
    return path


@pytest.fixture(scope="session")
def small(folder: Path) -> Path:
    path = folder / "small.ply"
    program("guardsplat-worker", "sample", path, "--gaussians", 8000, "--seed", 1)
    return path


@pytest.fixture
def tab(browser: Browser) -> Iterator[Page]:
    """A tab that nothing may go wrong in unseen, and that may ask nobody but the server."""
    context = browser.new_context(viewport={"width": 1000, "height": 900}, accept_downloads=True)
    page = context.new_page()
    wrong: list[str] = []
    hosts: set[str] = set()
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.on(
        "console",
        lambda message: wrong.append(message.text) if "Content Security Policy" in message.text else None,
    )
    page.on(
        "request",
        lambda request: hosts.add(request.url.split("/")[2]) if request.url.startswith("http") else None,
    )
    yield page
    assert wrong == []
    assert len(hosts) <= 1, hosts
    context.close()


def sign_in(page: Page, url: str, token: str) -> None:
    page.goto(url)
    page.get_by_label("Token").fill(token)
    page.get_by_role("button", name="Sign in").click()
    page.get_by_role("heading", name="Mark a scene").wait_for()


def keep(part: Locator, name: str) -> None:
    """Takes a picture for the documentation, where a folder is named for it."""
    if folder := os.environ.get("GUARDSPLAT_SCREENSHOTS"):
        part.screenshot(path=f"{folder}/{name}.png")
