#!/usr/bin/env python3
"""Reads pictures of marked scenes without a plain ground after changes of tones and noise (docs/evaluation/no-ground.csv).

    pip install numpy pillow
    tools/robustness/no_ground.py KEY MESSAGE SCENES WORKER [WORKER]

SCENES are marked ones, with commas between them; of several workers each reads the same pictures, as before and after a
change of the code. The first one renders.
"""
import json
import subprocess
import sys
import tempfile

import numpy
from PIL import Image

VIEWS = 3
CHANGES = {
    "gamma 1.2": lambda picture, _: picture**1.2,
    "brightness 0.85": lambda picture, _: picture * 0.85,
    "tint 1.05 1 0.96": lambda picture, _: picture * numpy.array([1.05, 1, 0.96]),
    "noise 0.05": lambda picture, random: picture + random.normal(0, 0.05, picture.shape),
}


def bits(worker, path, key, message):
    """Share of bits that are right, in percent; a claim that is no match is a result as well."""
    command = [worker, "verify", path, "--key", key, "--message", message, "--json"]
    told = subprocess.run(command, capture_output=True, text=True).stdout
    return 100 * json.loads(told)["bit_accuracy"]


def main(key, message, scenes, *workers):
    random = numpy.random.default_rng(2)
    print("scene,change,pictures," + ",".join(f"bits_{i + 1}_percent" for i in range(len(workers))))
    for scene in scenes.split(","):
        with tempfile.TemporaryDirectory() as folder:
            views = ["--views", str(VIEWS), "--size", "800", "--seed", "11"]
            subprocess.run([workers[0], "render", scene, folder, *views], check=True, capture_output=True)
            for name, change in CHANGES.items():
                read = numpy.zeros(len(workers))
                for view in range(VIEWS):
                    picture = numpy.asarray(Image.open(f"{folder}/view_{view:03}.png").convert("RGB"), float) / 255
                    changed = numpy.clip(change(picture, random), 0, 1) * 255
                    Image.fromarray(changed.round().astype(numpy.uint8)).save(f"{folder}/changed.png")
                    read += [bits(worker, f"{folder}/changed.png", key, message) for worker in workers]
                print(scene, name, VIEWS, *(read / VIEWS).round(1), sep=",", flush=True)


if __name__ == "__main__":
    if len(sys.argv) < 5:
        sys.exit(__doc__)
    main(*sys.argv[1:])
