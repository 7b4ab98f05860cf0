#!/usr/bin/env python3
"""Reads single pictures of a marked scene after changes of their tones (docs/evaluation/one-picture.csv).

    pip install numpy pillow
    tools/robustness/one_picture.py KEY MESSAGE SEED SCENE WORKER [WORKER]

Each of thirteen changes is done to one picture of 800 px, as much as the seed says, and kept as JPEG; a claim about that
picture alone is read. Of several workers each reads the same pictures, as before and after a change of the code. The first
one renders. Rows say how many bits are right in the reading that fits best, and the p-value with all hypotheses paid for.
"""
import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy
from PIL import Image

GREY = numpy.array([0.299, 0.587, 0.114])
QUALITY = {"screenshot": 80, "warm filter": 85}


def curve(picture, bend):
    """An S about the middle."""
    return picture + bend * picture * (1 - picture) * (2 * picture - 1)


def faded(picture, black):
    return picture * (1 - black) + black


def changed(picture, random):
    """The picture after each change, values not cut."""
    grey = (picture @ GREY)[..., None]
    page = Image.fromarray(bytes_of(picture * 1.05)).crop((80, 80, 720, 720)).resize((600, 600), Image.LANCZOS)
    return {
        "none": picture,
        "brightness 0.8 to 1.2": picture * random.uniform(0.8, 1.2),
        "tint 0.95 to 1.05": picture * random.uniform(0.95, 1.05, 3),
        "tint 0.85 to 1.15": picture * random.uniform(0.85, 1.15, 3),
        "gamma 0.8 to 1.25": picture ** random.uniform(0.8, 1.25),
        "contrast 0.8 to 1.2": picture.mean() + (picture - picture.mean()) * random.uniform(0.8, 1.2),
        "saturation 0.8 to 1.2": grey + (picture - grey) * random.uniform(0.8, 1.2),
        "curve -0.3 to 0.6": curve(picture, random.uniform(-0.3, 0.6)),
        "black at 0 to 0.15": faded(picture, random.uniform(0, 0.15)),
        "warm filter": faded(curve(numpy.clip(picture * [1.08, 1, 0.9], 0, 1), 0.3), 0.05),
        "screenshot": numpy.asarray(page, float) / 255,
        "brightness 0.5 to 0.7": picture * random.uniform(0.5, 0.7),
        "brightness 1.3 to 1.5": picture * random.uniform(1.3, 1.5),
    }


def bytes_of(picture):
    return (numpy.clip(picture, 0, 1) * 255).round().astype(numpy.uint8)


def main(key, message, seed, scene, *workers):
    with tempfile.TemporaryDirectory() as folder:
        views = ["--views", "1", "--size", "800", "--seed", seed]
        subprocess.run([workers[0], "render", scene, folder, *views], check=True, capture_output=True)
        picture = numpy.asarray(Image.open(f"{folder}/view_000.png").convert("RGB"), float) / 255
        for change, pixels in changed(picture, numpy.random.default_rng(int(seed))).items():
            path = f"{folder}/changed.jpg"
            Image.fromarray(bytes_of(pixels)).save(path, quality=QUALITY.get(change, 90))
            for worker in workers:
                command = [worker, "verify", path, "--key", key, "--message", message, "--json"]
                # A claim that is no match is a result as well.
                told = json.loads(subprocess.run(command, capture_output=True, text=True).stdout)
                row = [Path(scene).name, seed, change, Path(worker).name, told["matched_bits"], told["bits"]]
                print(*row, f"{told['p_value']:.2e}", told["verdict"], sep=",", flush=True)


if __name__ == "__main__":
    if len(sys.argv) < 6:
        sys.exit(__doc__)
    main(*sys.argv[1:])
