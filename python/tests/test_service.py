"""The client against a real server with a worker of its own."""

from __future__ import annotations

import asyncio
import hashlib
import signal
import subprocess
import threading
import time
import uuid
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import ENVIRONMENT, MESSAGE, PROGRAMS

import guardsplat

grpc = pytest.importorskip("grpc")


class Server:
    """A server whose data is in a folder, at the same place whenever it is started again."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.place = "127.0.0.1:0"
        self.process: subprocess.Popen[str] | None = None
        self.start()

    def start(self) -> None:
        command = [PROGRAMS / "guardsplat-server", "--listen", self.place, "--data-dir", self.folder / "data"]
        options = ["--embedded-worker", "true", "--worker-device", "cpu"]
        log = open(self.folder / "server.log", "a", encoding="utf-8")
        self.process = subprocess.Popen(
            [*map(str, command), *options], stdout=subprocess.PIPE, stderr=log, text=True, env=ENVIRONMENT
        )
        assert self.process.stdout is not None
        line = self.process.stdout.readline()
        assert line.startswith("listening on http://"), (line, (self.folder / "server.log").read_text())
        self.place = line.strip().removeprefix("listening on http://")

    @property
    def url(self) -> str:
        return f"http://{self.place}"

    def kill(self) -> None:
        assert self.process is not None
        self.process.kill()
        self.process.wait()

    def stop(self) -> None:
        assert self.process is not None
        self.process.send_signal(signal.SIGTERM)
        self.process.wait(30)


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    server = Server(tmp_path_factory.mktemp("server"))
    yield server
    server.stop()


@pytest.fixture(scope="module")
def client(server: Server) -> Iterator[guardsplat.Client]:
    with guardsplat.Client(server.url) as client:
        yield client


@pytest.fixture(scope="module")
def website(client: guardsplat.Client) -> Any:
    """A key of the server."""
    return client.create_key(32, seed=7, display_name="website")


@pytest.fixture(scope="module")
def of_server(client: guardsplat.Client, website: Any, scene: Path, folder: Path) -> Path:
    told: list[guardsplat.Progress] = []
    marked = folder / "of-server.ply"
    result = client.embed(
        scene,
        marked,
        key="website",
        message=MESSAGE,
        preset="draft",
        seed=3,
        force=True,
        comparison=folder / "comparison.png",
        progress=told.append,
    )
    assert result.bit_accuracy > 0.9 and result.gaussians == 8000
    assert {event.stage for event in told} & {"optimising", "reading"}
    assert (folder / "comparison.png").read_bytes().startswith(b"\x89PNG")
    return marked


def test_jobs_give_the_bytes_of_the_engine(of_server: Path, marked: Path) -> None:
    # The key has the same seed, so it is the same key.
    assert of_server.read_bytes() == marked.read_bytes()


def test_verdicts(client: guardsplat.Client, of_server: Path, scene: Path, folder: Path) -> None:
    views = folder / "server-views"
    views.mkdir()
    plt = pytest.importorskip("matplotlib.image")
    for index, picture in enumerate(guardsplat.render(of_server, views=2, device="cpu")):
        plt.imsave(views / f"{index}.png", picture)
    found = client.verify(views, key="website", message=MESSAGE)
    assert found.verdict == found.VERDICT_MATCH and found.views == 2
    # Pictures that match as given need no original, and one that is sent along does no harm.
    beside = client.verify(views, key="website", message=MESSAGE, original=scene)
    assert beside.verdict == beside.VERDICT_MATCH and not beside.explained_by_original
    none = client.verify(scene, key="website", message=MESSAGE, views=5)
    assert none.verdict == none.VERDICT_NO_MATCH and none.views == 5


def test_a_request_said_again_is_one_job(client: guardsplat.Client, server: Server, website: Any, scene: Path) -> None:
    request_id = str(uuid.uuid4())
    options: dict[str, Any] = {"key": website.name, "message": MESSAGE, "preset": "draft", "request_id": request_id}
    first = client.submit_embed(scene, **options)
    # As a process that was started anew would.
    with guardsplat.Client(server.url) as other:
        assert other.submit_embed(scene, **options).name == first.name
    assert client.cancel_job(first.name).name == first.name
    with pytest.raises(guardsplat.JobCancelled) as cancelled:
        client.wait(first)
    assert cancelled.value.job == first.name
    with pytest.raises(guardsplat.ServiceError) as other_job:
        client.submit_embed(scene, **{**options, "message": "00000000"})
    assert other_job.value.code == "ALREADY_EXISTS"
    assert first.name in [job.name for job in client.list_jobs(states=["cancelled"])]
    assert client.get_job(first.name).display_name == "scene.ply"


def test_failures_say_why(client: guardsplat.Client, website: Any, scene: Path, tmp_path: Path) -> None:
    text = tmp_path / "text.ply"
    text.write_text("hello")
    with pytest.raises(guardsplat.GuardSplatError) as failed:
        client.embed(text, tmp_path / "out.ply", key="website", message=MESSAGE)
    assert isinstance(failed.value, (guardsplat.JobFailed, guardsplat.ServiceError))
    with pytest.raises(guardsplat.ServiceError) as wrong:
        client.embed(scene, tmp_path / "out.ply", key="website", message="c0")
    assert (wrong.value.code, wrong.value.field) == ("INVALID_ARGUMENT", "job.embed.message")
    assert "job.embed.message" in wrong.value.violations
    with pytest.raises(guardsplat.ServiceError) as none:
        client.get_job(f"jobs/{uuid.uuid4()}")
    assert none.value.code == "NOT_FOUND"
    for options, field in (
        ({"key": "nobody's"}, "key"),
        ({"key": "website", "preset": "fast"}, "preset"),
        ({"key": "website", "robust_to": "rain"}, "robust_to"),
        ({"key": "website", "seed": -1}, "seed"),
        ({}, "key"),
    ):
        with pytest.raises(guardsplat.BadOption) as bad:
            client.submit_embed(scene, message=MESSAGE, **options)  # type: ignore[arg-type]
        assert bad.value.field == field
    with pytest.raises(TypeError, match="'mesage' is no option"):
        client.submit_embed(scene, key="website", mesage=MESSAGE)  # type: ignore[call-arg]
    with pytest.raises(TypeError, match="no path"):
        client.submit_verify([np.zeros((4, 4, 3))], key="website")  # type: ignore[list-item]
    assert list(tmp_path.iterdir()) == [text]


def test_the_registry(client: guardsplat.Client, scene: Path) -> None:
    client.create_key(64, display_name="assets")
    owner = client.create_owner("Studio Nord")
    again = str(uuid.uuid4())
    asset = client.create_asset(scene, owner="Studio Nord", key="assets", request_id=again)
    assert client.create_asset(scene, owner="Studio Nord", key="assets", request_id=again).name == asset.name
    assert asset.owner == owner.name and asset.sha256 == hashlib.sha256(scene.read_bytes()).hexdigest()
    assert [one.name for one in client.list_assets(owner="Studio Nord")] == [asset.name]
    assert [one.asset for one in client.list_commitments()] == [asset.name]
    assert [one.display_name for one in client.list_owners()] == ["Studio Nord"]
    assert client.public_key().pem.startswith("-----BEGIN PUBLIC KEY-----")
    assert "assets" in [key.display_name for key in client.list_keys()]
    claim = client.verify(scene, key="assets", owner="Studio Nord", views=2)
    assert claim.verdict == claim.VERDICT_NO_MATCH and claim.assets == 1


def test_files_there_and_back(client: guardsplat.Client, tmp_path: Path) -> None:
    data = np.random.default_rng(1).bytes(3 << 20)
    artifact = client.upload(data, display_name="noise")
    assert artifact.size_bytes == len(data) and artifact.display_name == "noise"
    client.download(artifact.name, tmp_path / "noise")
    assert (tmp_path / "noise").read_bytes() == data
    client.delete_artifact(artifact.name)
    with pytest.raises(guardsplat.ServiceError) as gone:
        client.download(artifact.name, tmp_path / "gone")
    assert gone.value.code == "NOT_FOUND"
    with pytest.raises(guardsplat.FileError):
        client.upload(tmp_path / "none")
    with pytest.raises(guardsplat.FileError):
        client.download(artifact.name, tmp_path / "no folder" / "file")
    assert [path.name for path in tmp_path.iterdir()] == ["noise"]


def test_a_server_that_dies_is_waited_for(tmp_path: Path, scene: Path) -> None:
    server = Server(tmp_path)
    with guardsplat.Client(server.url) as client:
        client.create_key(32, seed=7, display_name="website")
        events: list[guardsplat.Progress] = []
        started = threading.Event()

        def told(event: guardsplat.Progress) -> None:
            events.append(event)
            started.set()

        def restart() -> None:
            started.wait(60)
            server.kill()
            time.sleep(1)
            server.start()

        thread = threading.Thread(target=restart)
        thread.start()
        result = client.embed(
            scene,
            tmp_path / "out.ply",
            key="website",
            message=MESSAGE,
            preset="draft",
            seed=3,
            force=True,
            progress=told,
        )
        thread.join()
        assert result.bit_accuracy > 0.9 and (tmp_path / "out.ply").exists()
        assert len(client.list_jobs(states=["succeeded"])) == 2
    server.stop()
    with guardsplat.Client(server.url) as client, pytest.raises(guardsplat.ServerLost, match="can't be reached"):
        client.list_keys()


def test_an_interrupted_wait_cancels_if_asked_to(client: guardsplat.Client, website: Any, scene: Path) -> None:
    job = client.submit_embed(scene, key="website", message=MESSAGE, preset="thorough")

    def told(event: guardsplat.Progress) -> None:
        raise LookupError("enough")

    with pytest.raises(LookupError, match="enough"):
        client.wait(job, progress=told, cancel=True)
    with pytest.raises(guardsplat.JobCancelled):
        client.wait(job)


def test_the_twin_in_an_event_loop(server: Server, scene: Path, marked: Path, tmp_path: Path) -> None:
    async def work() -> None:
        async with guardsplat.AsyncClient(server.url) as client:
            key, scenes = await asyncio.gather(client.create_key(32, seed=7), client.list_keys())
            events: list[guardsplat.Progress] = []
            result, verdict = await asyncio.gather(
                client.embed(
                    scene,
                    tmp_path / "out.ply",
                    key=key.name,
                    message=MESSAGE,
                    preset="draft",
                    seed=3,
                    force=True,
                    progress=events.append,
                ),
                client.verify(marked, key=key.name, message=MESSAGE),
            )
            assert result.bit_accuracy > 0.9 and scenes
            assert verdict.verdict == verdict.VERDICT_MATCH
            assert (tmp_path / "out.ply").read_bytes() == marked.read_bytes()
            with pytest.raises(guardsplat.ServiceError) as none:
                await client.get_job(f"jobs/{uuid.uuid4()}")
            assert none.value.code == "NOT_FOUND"
            # A task that is cancelled cancels its job, if it is to.
            job = await client.submit_embed(scene, key=key.name, message=MESSAGE, preset="thorough")
            task = asyncio.create_task(client.wait(job, cancel=True))
            await asyncio.sleep(0.5)
            task.cancel()
            with pytest.raises(asyncio.CancelledError):
                await task
            with pytest.raises(guardsplat.JobCancelled):
                await client.wait(job)

    asyncio.run(work())


@pytest.mark.parametrize(
    ("url", "options", "field"),
    [
        ("127.0.0.1:1", {}, "url"),
        ("ftp://h:1", {}, "url"),
        ("http://h:1", {"ca": "/nowhere/ca.pem"}, "url"),
        ("https://h:1", {"certificate": "c.pem"}, "certificate"),
        ("http://h:1", {"token": "a b"}, "token"),
    ],
)
def test_addresses_and_tokens_are_checked(url: str, options: dict[str, Any], field: str) -> None:
    with pytest.raises(guardsplat.BadOption) as wrong:
        guardsplat.Client(url, **options)
    assert wrong.value.field == field


def test_tokens_are_shown(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[Any] = []

    class Listening(grpc.GenericRpcHandler):  # type: ignore[misc]
        def service(self, details: Any) -> Any:
            seen.append(dict(details.invocation_metadata).get("authorization"))
            return None

    from concurrent import futures

    server = grpc.server(futures.ThreadPoolExecutor(1), handlers=(Listening(),))
    port = server.add_insecure_port("127.0.0.1:0")
    server.start()
    (tmp_path / "token").write_text("gst_2_b\n")
    monkeypatch.setenv("GUARDSPLAT_TOKEN_FILE", str(tmp_path / "token"))
    for token in ("gst_1_a", None):
        with guardsplat.Client(f"http://127.0.0.1:{port}", token=token) as client:
            with pytest.raises(guardsplat.ServiceError) as refused:
                client.list_keys()
            assert refused.value.code == "UNIMPLEMENTED"
    assert seen == ["Bearer gst_1_a", "Bearer gst_2_b"]
    server.stop(None)


def test_generated_code_is_of_the_protos(tmp_path: Path) -> None:
    protoc = pytest.importorskip("grpc_tools.protoc")
    root = Path(__file__).parents[2]
    generated = root / "python/guardsplat/v1"
    names = sorted(path.name.replace("_pb2.py", ".proto") for path in generated.glob("*_pb2.py"))
    assert len(names) == 5
    arguments = ["", f"-I{root / 'proto'}", f"-I{Path(protoc.__file__).parent / '_proto'}"]
    outputs = [f"--python_out={tmp_path}", f"--pyi_out={tmp_path}"]
    assert protoc.main([*arguments, *outputs, *(f"guardsplat/v1/{name}" for name in names)]) == 0
    for path in (tmp_path / "guardsplat/v1").iterdir():
        assert path.read_text() == (generated / path.name).read_text(), f"{path.name}: deploy/python.sh protos"
