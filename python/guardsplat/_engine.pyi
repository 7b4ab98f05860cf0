"""The native half of the package: ``python/src`` in Rust."""

import os
from typing import TypedDict, final

from ._progress import ProgressTo

__version__: str

CameraNumbers = tuple[int, int, list[float], list[list[float]], list[float]]
"""Width and height; fx, fy, cx, cy; world to camera: rotation, by rows, and translation."""

EngineCameras = str | list[CameraNumbers] | None

class Arrays(TypedDict):
    means: bytes
    quats: bytes
    scales: bytes
    opacities: bytes
    sh: bytes
    degree: int

class EmbedOptions(TypedDict):
    preset: str
    seed: int
    device: str
    cameras: EngineCameras
    kind: str | None
    size: int | None
    robust_to: str | None
    learn: str
    ring: float | None
    settings: str | None
    clip: str | None
    force: bool
    ignore_bad_rows: bool
    memory: int | None

class ForecastOptions(TypedDict):
    key: Key | None
    bits: int
    message: str | None
    preset: str
    device: str

class VerifyOptions(TypedDict):
    views: int
    size: int | None
    background: list[float]
    original: str | None
    cameras: EngineCameras
    kind: str | None
    seed: int
    ignore_bad_rows: bool
    clip: str | None
    device: str
    memory: int | None
    logits: bool

class RenderOptions(TypedDict):
    views: int | None
    cameras: EngineCameras
    kind: str | None
    size: int | None
    background: list[float]
    seed: int
    ignore_bad_rows: bool
    device: str
    memory: int | None
    eight_bit: bool

@final
class Key:
    """A secret that messages are written and read with.

    Whoever has it can read, forge and remove its marks.
    """

    @staticmethod
    def create(
        bits: int = 32,
        seed: int | None = None,
        *,
        clip: str | None = None,
        device: str = "auto",
        progress: ProgressTo = None,
    ) -> Key:
        """Makes a key for messages of so many bits, 1 to 150.

        Without a seed it is random. With one it can be made again, and is no more secret than the seed.
        """
    @staticmethod
    def load(path: str | os.PathLike[str]) -> Key:
        """Reads a key file."""
    @staticmethod
    def from_bytes(data: bytes) -> Key:
        """A key from the bytes of its file."""
    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes the key file, readable by its owner only; a file that is there is replaced."""
    def to_bytes(self) -> bytes:
        """The bytes of the key file. They hold the secret."""
    @property
    def id(self) -> str:
        """32 hexadecimal digits that name the key and give nothing of the secret away."""
    @property
    def bits(self) -> int:
        """Bits of its messages."""
    @property
    def clip(self) -> str:
        """The CLIP that it reads with."""
    @property
    def bit_accuracy_unseen(self) -> float | None:
        """Share of bits that its decoder reads right of messages it was not made with."""

def embed(input: str, output: str, key: Key, message: str, options: EmbedOptions, progress: ProgressTo) -> str: ...
def embed_gaussians(
    arrays: Arrays, key: Key, message: str, options: EmbedOptions, progress: ProgressTo
) -> tuple[str, bytearray]: ...
def verify(
    paths: list[str],
    pictures: list[tuple[int, int, bytes]],
    key: Key,
    message: str | None,
    options: VerifyOptions,
    progress: ProgressTo,
) -> str: ...
def inspect(
    path: str,
    views: int | None,
    cameras: EngineCameras,
    kind: str | None,
    ignore_bad_rows: bool,
    memory: int | None,
    forecast: ForecastOptions | None,
) -> str: ...
def render(path: str, options: RenderOptions, progress: ProgressTo) -> list[tuple[bytearray, CameraNumbers]]: ...
def render_gaussians(
    arrays: Arrays, options: RenderOptions, progress: ProgressTo
) -> list[tuple[bytearray, CameraNumbers]]: ...
def sample(path: str, kind: str, gaussians: int, sh_degree: int, seed: int, cameras: str | None) -> None: ...
def load_gaussians(path: str, ignore_bad_rows: bool, memory: int | None) -> tuple[list[bytearray], int]: ...
def save_gaussians(path: str, arrays: Arrays) -> None: ...
def read_cameras(path: str) -> list[CameraNumbers]: ...
def write_cameras(path: str, cameras: list[CameraNumbers]) -> None: ...
