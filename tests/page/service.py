"""A real server with its page, and a way to it that can break off."""

from __future__ import annotations

import os
import selectors
import signal
import socket
import subprocess
import threading
import time
import uuid
from pathlib import Path

PROGRAMS = Path(os.environ.get("CARGO_TARGET_DIR", Path(__file__).parents[2] / "target")).resolve() / "release"
# What the programs would take for settings is not of the tests.
ENVIRONMENT = {name: value for name, value in os.environ.items() if not name.startswith("GUARDSPLAT_")}
SCOPES = ("admin", "embed", "verify")


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def program(name: str, *arguments: object, token: str | None = None) -> str:
    """Runs a program to its end, which must be a good one, and gives what it says."""
    command = [str(PROGRAMS / name), *map(str, arguments)]
    environment = ENVIRONMENT | ({"GUARDSPLAT_TOKEN": token} if token else {})
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    assert done.returncode == 0, f"{command}: {done.stderr}"
    return done.stdout.strip()


class Service:
    """A server that asks for tokens, on ports that stay the same when it begins anew."""

    def __init__(self, folder: Path, *settings: object) -> None:
        self.folder = folder
        self.api, self.page = free_port(), free_port()
        self.settings = settings
        self.log = folder.with_suffix(".log")
        self.process: subprocess.Popen[bytes] | None = None
        self.start()

    def start(self) -> None:
        command = [
            str(PROGRAMS / "guardsplat-server"),
            "--data-dir",
            str(self.folder),
            "--access",
            "tokens",
        ]
        command += [
            "--listen",
            f"127.0.0.1:{self.api}",
            "--page-listen",
            f"127.0.0.1:{self.page}",
        ]
        command += ["--worker-device", "cpu", *map(str, self.settings)]
        with self.log.open("ab") as log:
            self.process = subprocess.Popen(command, stdout=log, stderr=log, env=ENVIRONMENT)
        for _ in range(600):
            assert self.process.poll() is None, self.log.read_text()
            with socket.socket() as probe:
                if probe.connect_ex(("127.0.0.1", self.page)) == 0:
                    return
            time.sleep(0.05)
        raise AssertionError(self.log.read_text())

    def stop(self) -> None:
        if self.process and self.process.poll() is None:
            self.process.send_signal(signal.SIGTERM)
            self.process.wait(60)

    def token(self, *scopes: str) -> str:
        given = [word for scope in scopes or SCOPES for word in ("--scope", scope)]
        return program(
            "guardsplat-server",
            "--data-dir",
            self.folder,
            "token",
            "create",
            "--project",
            "studio",
            *given,
        )

    def revoke(self, token: str) -> None:
        name = f"tokens/{uuid.UUID(token.split('_')[1])}"
        program("guardsplat-server", "--data-dir", self.folder, "token", "revoke", name)

    def client(self, token: str, *arguments: object) -> str:
        return program(
            "guardsplat",
            "--server",
            f"http://127.0.0.1:{self.api}",
            *arguments,
            token=token,
        )


class Way:
    """Hands bytes on to a port. It counts what is sent there, and can break off."""

    def __init__(self, to: int) -> None:
        self.to = to
        self.sent = 0
        self.received = 0
        # All connections end once so many bytes went there, or came back, and for a while there is no other.
        self.break_after: int | None = None
        self.break_back_after: int | None = None
        self.broken = 0
        self.closed_until = 0.0
        self.lock = threading.Lock()
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.url = f"http://127.0.0.1:{self.listener.getsockname()[1]}"
        threading.Thread(target=self._accept, daemon=True).start()

    def _accept(self) -> None:
        while True:
            try:
                browser, _ = self.listener.accept()
            except OSError:
                return
            threading.Thread(target=self._carry, args=(browser,), daemon=True).start()

    def _carry(self, browser: socket.socket) -> None:
        with browser:
            if time.monotonic() < self.closed_until:
                return
            try:
                server = socket.create_connection(("127.0.0.1", self.to), timeout=5)
            except OSError:
                return
            with server, selectors.DefaultSelector() as both:
                both.register(browser, selectors.EVENT_READ, server)
                both.register(server, selectors.EVENT_READ, browser)
                while True:
                    for ready, _ in both.select(0.5):
                        try:
                            some = ready.fileobj.recv(1 << 16)
                            if not some or self._breaks(len(some), ready.fileobj is browser):
                                return
                            ready.data.sendall(some)
                        except OSError:
                            return

    def _breaks(self, count: int, there: bool) -> bool:
        with self.lock:
            if there:
                self.sent += count
            else:
                self.received += count
            if time.monotonic() < self.closed_until:
                return True
            if self.break_after is not None and self.sent >= self.break_after:
                self.break_after = None
            elif self.break_back_after is not None and self.received >= self.break_back_after:
                self.break_back_after = None
            else:
                return False
            self.broken += 1
            self.closed_until = time.monotonic() + 1.5
            return True
