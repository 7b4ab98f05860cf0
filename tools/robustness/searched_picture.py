#!/usr/bin/env python3
"""Times claims about one picture whose tones are searched (docs/evaluation/searched-picture.csv).

    pip install numpy pillow
    tools/robustness/searched_picture.py KEY PLANT DONUT ROOM WORKER [WORKER]

PLANT, DONUT and ROOM are marked scenes. What is claimed is a message that they do not carry, so that all ways are read. Of
several workers each reads the same pictures in turns; the first one renders. Nothing else should run.
"""
import json
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy
from PIL import Image

from one_picture import GREY, bytes_of, curve, faded

RUNS = 3


def pictures(folder, worker, *scenes):
    def view(scene):
        command = [worker, "render", scene, folder, "--views", "1", "--size", "800", "--seed", "501"]
        subprocess.run(command, check=True, capture_output=True)
        return numpy.asarray(Image.open(f"{folder}/view_000.png").convert("RGB"), float) / 255

    plant, donut, room = map(view, scenes)
    grey = (plant @ GREY)[..., None]
    return {
        "plant as it is": plant,
        "plant with 0.85 of its saturation": grey + (plant - grey) * 0.85,
        "donut 1.15 times as bright": donut * 1.15,
        "plant under a warm filter": faded(curve(numpy.clip(plant * [1.08, 1, 0.9], 0, 1), 0.3), 0.05),
        "room with a tint of 1.12 1 0.9": room * [1.12, 1, 0.9],
    }


def processor_seconds():
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def main(key, plant, donut, room, *workers):
    print("picture_800px,worker,run,ways,wall_s,processor_s")
    with tempfile.TemporaryDirectory() as folder:
        shown = pictures(folder, workers[0], plant, donut, room)
        for run in range(RUNS):
            for worker in workers:
                for name, picture in shown.items():
                    Image.fromarray(bytes_of(picture)).save(f"{folder}/picture.png")
                    command = [worker, "verify", f"{folder}/picture.png", "--key", key, "--message", "c0ffee42", "--json"]
                    began, before = time.monotonic(), processor_seconds()
                    told = subprocess.run(command, capture_output=True, text=True).stdout
                    wall, processors = time.monotonic() - began, processor_seconds() - before
                    ways = json.loads(told)["framings"]
                    print(name, Path(worker).name, run + 1, ways, f"{wall:.2f},{processors:.2f}", sep=",", flush=True)


if __name__ == "__main__":
    if len(sys.argv) < 6:
        sys.exit(__doc__)
    main(*sys.argv[1:])
