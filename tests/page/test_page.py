"""The page as people use it: in a real browser, with a real server and real jobs."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from conftest import keep, sign_in
from playwright.sync_api import Browser, Page, Route, expect
from service import Service, Way

MESSAGE = "c0ffee42"
# A job on two busy cores.
LONG = 240_000
REPOSITORY = Path(__file__).parents[2]


def address(service: Service) -> str:
    return f"http://127.0.0.1:{service.page}"


def test_only_with_a_token(service: Service, token: str, tab: Page) -> None:
    url = address(service)
    tab.goto(url + "/#jobs")
    expect(tab.get_by_role("heading", name="Sign in")).to_be_visible()
    expect(tab.get_by_role("navigation")).to_be_hidden()
    for wrong, told in [
        ("gst_0_0", "The token is not known."),
        (service.token("worker"), "This token is not for that"),
    ]:
        tab.get_by_label("Token").fill(wrong)
        tab.keyboard.press("Enter")
        expect(tab.get_by_role("alert")).to_contain_text(told)
        expect(tab.get_by_label("Token")).to_be_focused()
    tab.get_by_label("Token").fill(token)
    tab.keyboard.press("Enter")
    expect(tab.get_by_role("heading", name="Jobs")).to_be_focused()
    assert token not in tab.url
    assert tab.evaluate("() => localStorage.length") == 0
    tab.reload()
    expect(tab.get_by_role("heading", name="Jobs")).to_be_visible()
    # By keyboard alone.
    tab.get_by_role("link", name="Verify").focus()
    tab.keyboard.press("Enter")
    expect(tab.get_by_role("heading", name="Verify")).to_be_focused()
    tab.get_by_role("button", name="Sign out").click()
    expect(tab.get_by_role("heading", name="Sign in")).to_be_visible()
    assert tab.evaluate("() => sessionStorage.length") == 0
    # One that is taken back meanwhile.
    other = service.token()
    sign_in(tab, url, other)
    service.revoke(other)
    tab.get_by_role("link", name="Jobs").click()
    expect(tab.get_by_role("alert")).to_contain_text("The token is revoked.")
    assert tab.evaluate("() => sessionStorage.length") == 0


def test_a_scene_is_marked_and_a_picture_of_it_verified(
    service: Service, token: str, key: str, scene: Path, tab: Page, folder: Path
) -> None:
    way = Way(service.page)
    sign_in(tab, way.url, token)
    tab.locator("#mark-file").set_input_files(scene)
    tab.locator("#mark-key").select_option(key)
    tab.locator("#mark-message").fill(MESSAGE)
    # The connection breaks off in the middle, and for a while there is none.
    before, size = way.sent, scene.stat().st_size
    assert size > 4 << 20
    way.break_after = before + (5 << 19)
    tab.get_by_role("button", name="Mark the scene").click()
    expect(tab.locator("#mark-job")).to_contain_text("The server can't be reached. Trying again.", timeout=30_000)
    expect(tab.locator("#mark-job")).to_contain_text(re.compile("Waiting|Preparing|Working"), timeout=60_000)
    assert way.broken == 1
    # It went on where it was: what was on its way went there twice, and nothing else.
    assert way.sent - before < size + (2 << 20), f"{way.sent - before} bytes for a file of {size}"
    # So it does while the marked scene comes back.
    came = way.received
    way.break_back_after = came + (2 << 20)

    result = tab.locator("#mark-result")
    expect(result.get_by_role("heading", name="The marked scene")).to_be_focused(timeout=LONG)
    expect(result.locator("figcaption")).to_have_text(["Before", "After", "Difference, ten times"])
    with tab.expect_download() as download:
        result.get_by_role("button", name="Download marked.ply").click()
    marked = folder / "marked.ply"
    download.value.save_as(marked)
    assert marked.stat().st_size == size
    assert way.broken == 2
    assert way.received - came < size + (4 << 20), f"{way.received - came} bytes for a file of {size}"
    assert marked.read_bytes() != scene.read_bytes()

    result.get_by_role("button", name="Turn it here").click()
    canvas = result.get_by_role("application")
    expect(canvas).to_be_focused(timeout=LONG)
    for pressed in ["ArrowRight", "ArrowRight", "ArrowUp", "+"]:
        tab.keyboard.press(pressed)
    result.get_by_role("button", name="Take a picture").click()
    result.get_by_role("button", name="Check it").wait_for(timeout=LONG)
    keep(result, "marked")
    result.get_by_role("button", name="Check it").click(timeout=LONG)
    expect(tab.get_by_role("heading", name="Verify")).to_be_focused()
    expect(tab.locator("#verify-list")).to_contain_text("marked-1.png")
    expect(tab.locator("#verify-message")).to_have_value(MESSAGE)
    tab.get_by_role("button", name="Verify").click()
    found = tab.locator("#verify-result")
    expect(found.get_by_role("heading", name="The mark is there")).to_be_focused(timeout=LONG)
    expect(found).to_contain_text("of 32 bits agree")
    # The rank sum that a match of a picture as given needs: 498 of 528.
    expect(found).to_contain_text("agree; 94.3 % are needed")
    expect(found).to_contain_text("What it does not say")

    # Another message is not there.
    tab.locator("#verify-message").fill("00000000")
    tab.get_by_role("button", name="Verify").click()
    expect(found.get_by_role("heading", name="The mark was not found")).to_be_visible(timeout=LONG)

    # What was done is under Jobs, with who did it.
    tab.get_by_role("link", name="Jobs").click()
    tab.get_by_label("Show").select_option("All")
    marking = tab.locator("#jobs-list > li").filter(has_text="Marking: sample.ply")
    marking.get_by_role("button", name="Attempts").click()
    expect(marking).to_contain_text(re.compile(r"Attempt 1, .*, worker .*: succeeded"))
    # What came of it is there too, for who closed the page meanwhile.
    with tab.expect_download() as download:
        marking.get_by_role("button", name="Download the marked scene").click()
    assert download.value.path().read_bytes() == marked.read_bytes()
    verified = tab.locator("#jobs-list > li").filter(has_text="Verifying: marked-1.png").first
    verified.get_by_role("button", name="Show the verdict").click()
    expect(verified.get_by_role("heading", name="The mark was not found")).to_be_focused()
    expect(verified).to_contain_text("It says the message 00000000")
    expect(verified).to_contain_text(key)
    # And who could do more.
    workers = tab.get_by_role("list", name="Workers").get_by_role("listitem")
    expect(workers).to_have_count(1)
    expect(workers).to_contain_text("Waits for a job.")
    expect(workers).to_contain_text(re.compile(r"version \d.*, last heard of .*\d"))


def test_a_worker_is_seen_with_its_job_by_admins(
    service: Service, token: str, small: Path, key: str, tab: Page
) -> None:
    name = key.split()[0]
    long = ("--preset", "thorough", "--display-name", "long")
    job = service.client(token, "embed", small, "--key", name, "--message", MESSAGE, "--no-wait", *long).split()[0]
    sign_in(tab, address(service), token)
    tab.get_by_role("link", name="Jobs").click()
    workers = tab.get_by_role("list", name="Workers").get_by_role("listitem")
    had = re.compile(f"Has attempt 1 of {job.removeprefix('jobs/')}, since ")
    for _ in range(60):
        tab.get_by_role("button", name="Look again").click()
        expect(workers).to_have_count(1)
        if had.search(workers.inner_text()):
            break
        tab.wait_for_timeout(500)
    expect(workers).to_contain_text(had)
    # Who looks twice in a row sees a job once, though the first look is answered last.
    waiting: list[Route] = []
    tab.route("**/ListJobs", lambda route: waiting.append(route))
    tab.get_by_role("button", name="Look again").dblclick()
    for _ in range(100):
        if len(waiting) == 2:
            break
        tab.wait_for_timeout(100)
    assert len(waiting) == 2
    for route in reversed(waiting):
        with tab.expect_response("**/ListWorkers"):
            route.continue_()
    tab.unroute("**/ListJobs")
    mine = tab.locator("#jobs-list > li").filter(has_text="long")
    expect(mine).to_have_count(1)
    mine.get_by_role("button", name="Cancel").click()
    # Whoever may not see workers sees the jobs all the same.
    other = tab.context.new_page()
    sign_in(other, address(service), service.token("embed"))
    other.get_by_role("link", name="Jobs").click()
    expect(other.locator("#jobs-summary")).not_to_be_empty()
    expect(other.get_by_role("heading", name="Workers")).to_be_hidden()
    expect(other.locator("#jobs-alert")).to_be_hidden()
    other.close()


def test_an_owner_is_registered_and_found(service: Service, token: str, small: Path, tab: Page, folder: Path) -> None:
    # Always the same one, which marks the scene well.
    service.client(token, "key", "create", "--bits", 64, "--display-name", "originals", "--seed", 3)
    sign_in(tab, address(service), token)
    tab.locator("#mark-file").set_input_files(small)
    tab.get_by_label("A mark of its owner, which is registered now").check()
    expect(tab.locator("#mark-key option")).to_have_text(["originals (64 bits)"])
    mark = tab.get_by_role("button", name="Mark the scene")
    mark.click()
    expect(tab.locator("#mark-form").get_by_role("alert")).to_contain_text("The owner has no name.")

    # A claim on what is not registered says so.
    tab.get_by_role("link", name="Verify").click()
    tab.locator("#verify-files").set_input_files(small)
    tab.locator("#verify-key").select_option("originals (64 bits)")
    tab.get_by_label("It is any registered original of this key").check()
    tab.get_by_role("button", name="Verify").click()
    found = tab.locator("#verify-result")
    expect(found.get_by_role("heading", name="Nothing is registered to compare with")).to_be_focused(timeout=LONG)

    tab.get_by_role("link", name="Mark").click()
    tab.get_by_label("Name of a new owner").fill("Studio Nord")
    mark.click()
    result = tab.locator("#mark-result")
    with tab.expect_download(timeout=LONG) as download:
        result.get_by_role("button", name="Download marked.ply").click(timeout=LONG)
    copy = folder / "copy of somebody.ply"
    download.value.save_as(copy)
    tab.get_by_role("link", name="Verify").click()
    tab.locator("#verify-files").set_input_files(copy)
    tab.get_by_role("button", name="Verify").click()
    expect(found.get_by_role("heading", name="The mark is there")).to_be_focused(timeout=LONG)
    expect(found).to_contain_text("small.ply (number 1), of Studio Nord")
    keep(found, "verdict")
    for name in ("evidence.html", "evidence.json"):
        with tab.expect_download() as download:
            found.get_by_role("button", name=f"Download {name}").click()
        evidence = folder / name
        download.value.save_as(evidence)
        service.client(token, "report", "check", evidence)


def test_a_key_is_made(service: Service, token: str, tab: Page) -> None:
    sign_in(tab, address(service), token)
    tab.locator("#new-key").evaluate("(details) => { details.open = true; }")
    tab.get_by_label("Its name").fill("short")
    tab.get_by_label("Bits of its messages").select_option("16")
    tab.get_by_role("button", name="Make the key").click()
    expect(tab.locator("#mark-key")).to_be_focused(timeout=LONG)
    expect(tab.locator("#mark-key option:checked")).to_have_text("short (16 bits)")


def test_mistakes_say_what_to_do(service: Service, token: str, key: str, tab: Page, folder: Path) -> None:
    sign_in(tab, address(service), token)
    alert = tab.locator("#mark-form").get_by_role("alert")
    mark = tab.get_by_role("button", name="Mark the scene")
    tab.locator("#mark-key").select_option(key)
    bad = folder / "letter.ply"
    bad.write_text("Dear reader, this is no scene.")
    tab.locator("#mark-file").set_input_files(bad)
    tab.locator("#mark-message").fill("c0ffee")
    mark.click()
    expect(alert).to_contain_text("The message must be 8 hexadecimal digits")
    tab.get_by_role("button", name="Draw one").click()
    expect(tab.locator("#mark-message")).to_have_value(re.compile("^[0-9a-f]{8}$"))
    mark.click()
    expect(alert).to_contain_text(re.compile("(PLY|scene|letter)", re.IGNORECASE), timeout=LONG)
    expect(mark).to_be_focused()
    empty = folder / "empty.ply"
    empty.touch()
    tab.locator("#mark-file").set_input_files(empty)
    mark.click()
    expect(alert).to_contain_text("empty.ply is empty.")


def test_files_are_dropped(service: Service, token: str, tab: Page) -> None:
    """On their places, and nowhere else: a browser would open them instead of the page."""
    sign_in(tab, address(service), token)
    drop = """([place, type, name]) => {
        const dataTransfer = new DataTransfer();
        dataTransfer.items.add(new File(["ply"], name));
        const event = new DragEvent(type, { bubbles: true, cancelable: true, dataTransfer });
        document.querySelector(place).dispatchEvent(event);
        return event.defaultPrevented;
    }"""
    for place, name in [("#mark-drop", "scene.ply"), ("#verify-drop", "picture.png")]:
        assert tab.evaluate(drop, [place, "drop", name])
    assert tab.evaluate("() => document.getElementById('mark-file').files[0].name") == "scene.ply"
    tab.get_by_role("link", name="Verify").click()
    expect(tab.locator("#verify-list")).to_contain_text("picture.png")
    for what in ("dragover", "drop"):
        assert tab.evaluate(drop, ["footer", what, "beside.ply"])
    assert tab.evaluate("() => document.getElementById('mark-file').files[0].name") == "scene.ply"


def test_a_full_queue_and_a_server_that_goes_away(tab: Page, folder: Path) -> None:
    service = Service(folder / "full", "--embedded-worker", "false", "--max-queued-jobs", 1)
    try:
        token = service.token()
        sign_in(tab, address(service), token)
        make = tab.get_by_role("button", name="Make the key")
        # There is no key, so how to make one is open.
        make.click()
        panel = tab.locator("#key-job")
        expect(panel).to_contain_text("Waiting. It is next.")
        other = tab.context.new_page()
        sign_in(other, address(service), token)
        other.get_by_role("button", name="Make the key").click()
        alert = other.locator("#mark-form").get_by_role("alert")
        expect(alert).to_contain_text("1 jobs are waiting")
        expect(alert).to_contain_text("Try again in a few minutes.")
        other.close()

        service.stop()
        expect(panel).to_contain_text("The server can't be reached. Trying again.", timeout=20_000)
        service.start()
        expect(panel).not_to_contain_text("can't be reached", timeout=30_000)
        expect(panel).to_contain_text("Waiting. It is next.")
        panel.get_by_role("button", name="Stop").click()
        expect(tab.locator("#mark-form").get_by_role("alert")).to_contain_text("The job was cancelled.", timeout=20_000)
        tab.get_by_role("link", name="Jobs").click()
        tab.get_by_label("Show").select_option("All")
        expect(tab.locator("#jobs-list > li")).to_contain_text("Cancelled.")
    finally:
        service.stop()


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize(("width", "height"), [(1000, 900), (360, 740)])
def test_nothing_keeps_people_out(
    browser: Browser,
    service: Service,
    token: str,
    key: str,
    small: Path,
    scheme: str,
    width: int,
    height: int,
) -> None:
    axe = (REPOSITORY / "tools/page/node_modules/axe-core/axe.min.js").read_text()
    # The tool is a script of its own, which the policy would not let in.
    context = browser.new_context(
        viewport={"width": width, "height": height},
        color_scheme=scheme,
        bypass_csp=True,
    )
    page = context.new_page()
    page.goto(address(service))
    page.evaluate(axe)
    found = []

    def check(what: str) -> None:
        result = page.evaluate("() => axe.run(document, { resultTypes: ['violations'] })")
        bad = [one for one in result["violations"] if one["impact"] in ("serious", "critical")]
        found.extend(f"{what}: {one['id']} {one['nodes'][0]['html'][:120]}" for one in bad)
        wide = page.evaluate("() => document.documentElement.scrollWidth - innerWidth")
        if wide > 0:
            found.append(f"{what} is {wide} pixels too wide")

    check("sign in")
    page.get_by_label("Token").fill(token)
    page.keyboard.press("Enter")
    page.get_by_role("heading", name="Mark a scene").wait_for()
    page.locator("#new-key").evaluate("(details) => { details.open = true; }")
    for choice in ("message", "register", "asset"):
        page.locator(f'input[name="mark-what"][value="{choice}"]').check()
        check(f"mark {choice}")
    # What is there while something goes on, after it failed, and the viewer.
    page.locator("#mark-file").set_input_files(small)
    page.evaluate(
        """async () => {
            const [{ Panel }, { alertIn }, { show }] = await Promise.all(
                ["jobs", "elements", "viewer"].map((name) => import(`/${name}.js`)),
            );
            const panel = new Panel(document.getElementById("mark-job"));
            panel.show("Sending", 0.5);
            panel.note("The server can't be reached. Trying again.");
            alertIn(document.querySelector("#mark-form .alert"), { what: "The scene is empty.", todo: "Choose another." });
            const box = document.getElementById("mark-result");
            box.hidden = false;
            await show(box, document.getElementById("mark-file").files[0], () => {});
        }"""
    )
    check("mark with all there is")
    page.get_by_role("link", name="Verify").click()
    page.get_by_role("heading", name="Verify").wait_for()
    check("verify")
    for kind in (1, 2, 3):
        page.evaluate(
            """async (kind) => {
                const { verdict } = await import("/verdict.js");
                const result = { verdict: kind, bits: 32, views: 1, framings: 281, assets: 0n, ignoredRows: 0n,
                    matchedBits: 31, neededBits: 28, pValue: 1e-8, threshold: 1e-6, reason: "" };
                const box = document.getElementById("verify-result");
                box.replaceChildren(...verdict(result, { files: "a.png", key: "studio", claim: "It says c0ffee42" }));
                box.hidden = false;
            }""",
            kind,
        )
        check(f"verdict {kind}")
    page.get_by_role("link", name="Jobs").click()
    page.get_by_role("heading", name="Jobs").wait_for()
    page.get_by_label("Show").select_option("All")
    expect(page.locator("#jobs-list > li").first).to_be_visible()
    for button in ("Attempts", "Show the verdict"):
        if page.get_by_role("button", name=button).count() > 0:
            page.get_by_role("button", name=button).first.click()
            page.wait_for_timeout(500)
    check("jobs")
    context.close()
    assert found == []
