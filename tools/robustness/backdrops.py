#!/usr/bin/env python3
"""Reads a marked object's pictures over what viewers and sites have behind one: docs/evaluation.md, "Backdrops".

    pip install pillow numpy
    tools/robustness/backdrops.py WORKER SCENE KEY MESSAGE [PHOTO...]

WORKER is the program guardsplat-worker, SCENE a marked one. Renders three views over white and over black, which tells how much
of a backdrop shows where; puts them over backdrops, as PNG and as JPEG 80; reads them together as a claim does, and prints a
row of docs/evaluation/backdrops.csv each.
"""
import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy
from PIL import Image

VIEWS, SIZE, SEED = 3, 800, 93
Y, X = numpy.mgrid[0:SIZE, 0:SIZE] / (SIZE - 1)
FROM_THE_MIDDLE = numpy.hypot(X - 0.5, Y - 0.5)
FLOOR = 1 / (1 + numpy.exp(-40 * (Y - 0.7)))


def of(*channels):
    """A backdrop of one grey, or of red, green and blue."""
    channels = channels if len(channels) == 3 else 3 * channels
    return numpy.stack([numpy.broadcast_to(c, X.shape) for c in channels], -1)


BACKDROPS = {
    "white": of(1.0),
    "black": of(0.0),
    "grey 0.2": of(0.2),
    "grey 0.5": of(0.5),
    "dark blue": of(0.1, 0.12, 0.25),
    "dark to grey": of(0.15 + 0.5 * Y),
    "dark corners": of(0.45 - 0.5 * FROM_THE_MIDDLE),
    "blue gradient": of(0.2 + 0.3 * Y, 0.3 + 0.3 * Y, 0.6 + 0.3 * Y),
    "grey to white": of(0.6 + 0.35 * Y),
    "sky": of(0.55 + 0.4 * Y, 0.75 + 0.22 * Y, 0.95 + 0.03 * Y),
    "spot of light": of(0.95 - 0.4 * FROM_THE_MIDDLE),
    "wall and floor": of(0.75 + 0.15 * FLOOR),
    "checkerboard": of(0.4 + 0.2 * ((numpy.floor(20 * X) + numpy.floor(20 * Y)) % 2)),
}


def rendered(worker, scene, folder, ground, views=VIEWS, size=SIZE, seed=SEED):
    """Held-out views of a scene over a ground, each of numbers from 0 to 1."""
    out = Path(folder) / ground
    render = [worker, "render", scene, out, "--views", str(views), "--size", str(size), "--seed", str(seed)]
    subprocess.run([*render, "--background", ground, "--device", "cpu"], check=True, capture_output=True)
    return [numpy.asarray(Image.open(path).convert("RGB"), float) / 255 for path in sorted(out.glob("*.png"))]


def photo(path):
    return numpy.asarray(Image.open(path).convert("RGB").resize((SIZE, SIZE)), float) / 255


def main():
    worker, scene, key, message, *photos = sys.argv[1:]
    backdrops = BACKDROPS | {f"photo {number + 1}": photo(path) for number, path in enumerate(photos)}
    with tempfile.TemporaryDirectory() as folder:
        views = list(zip(rendered(worker, scene, folder, "white"), rendered(worker, scene, folder, "black")))
        for name, backdrop in backdrops.items():
            for kind, options in ("png", {}), ("jpg", {"quality": 80}):
                shown = Path(folder) / f"{name}-{kind}".replace(" ", "-")
                shown.mkdir()
                for number, (white, black) in enumerate(views):
                    shows = (white - black).mean(-1, keepdims=True).clip(0, 1)
                    pixels = (255 * (black + shows * backdrop)).round().clip(0, 255).astype(numpy.uint8)
                    Image.fromarray(pixels).save(shown / f"{number}.{kind}", **options)
                command = [worker, "verify", shown, "--key", key, "--message", message, "--device", "cpu", "--json"]
                # The exit code says whether it matched.
                told = json.loads(subprocess.run(command, capture_output=True, check=False).stdout)
                right = f"{100 * told['bit_accuracy']:.1f}"
                row = [Path(scene).name, name, kind, told["matched_bits"], told["bits"], right, f"{told['p_value']:.1e}"]
                print(",".join(map(str, [*row, told["verdict"]])), flush=True)


if __name__ == "__main__":
    main()
