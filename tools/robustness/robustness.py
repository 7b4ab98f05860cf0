#!/usr/bin/env python3
"""Measures what a mark survives: renders a marked scene, does things to the pictures, and has them verified.

    pip install pillow numpy
    tools/robustness/robustness.py WORKER SCENE KEY MESSAGE

WORKER is the program guardsplat-worker. Prints a row of a Markdown table for each distortion.
"""
import io
import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy
from PIL import Image, ImageEnhance, ImageFilter

VIEWS = "20"
SIZE = 160


def jpeg(quality):
    def apply(picture):
        file = io.BytesIO()
        picture.save(file, "JPEG", quality=quality)
        return Image.open(file).convert("RGB")

    return apply


def noise(deviation):
    random = numpy.random.RandomState(0)

    def apply(picture):
        values = numpy.asarray(picture, float) + 255 * deviation * random.randn(SIZE, SIZE, 3)
        return Image.fromarray(values.clip(0, 255).round().astype(numpy.uint8))

    return apply


def crop(share):
    border = round(SIZE * (1 - share) / 2)
    return lambda picture: picture.crop((border, border, SIZE - border, SIZE - border))


def brightness(factor):
    return lambda picture: ImageEnhance.Brightness(picture).enhance(factor)


DISTORTIONS = {
    "nothing": lambda picture: picture,
    "cropped to 80 %": crop(0.8),
    "half the size": lambda picture: picture.resize((SIZE // 2, SIZE // 2), Image.LANCZOS),
    "blur of 1 px": lambda picture: picture.filter(ImageFilter.GaussianBlur(1)),
    "brightness x 1.05": brightness(1.05),
    "brightness x 1.2": brightness(1.2),
    "JPEG, quality 95": jpeg(95),
    "JPEG, quality 75": jpeg(75),
    "JPEG, quality 50": jpeg(50),
    "noise of 0.02": noise(0.02),
}


def main():
    worker, scene, key, message = sys.argv[1:5]

    def run(*arguments):
        return subprocess.run([worker, *map(str, arguments)], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)

    def row(name, pictures):
        # Any verdict will do; only errors print no JSON.
        found = json.loads(run("verify", pictures, "--key", key, "--message", message, "--json").stdout)
        accuracy = 100 * found["bit_accuracy"]
        print(f"| {name} | {accuracy:.1f} % | {found['matched_bits']} of {found['bits']} |", flush=True)

    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        clean = folder / "clean"
        run("render", scene, clean, "--views", VIEWS, "--size", SIZE).check_returncode()
        for index, (name, distort) in enumerate(DISTORTIONS.items()):
            distorted = folder / str(index)
            distorted.mkdir()
            for path in sorted(clean.glob("*.png")):
                distort(Image.open(path).convert("RGB")).save(distorted / path.name)
            row(name, distorted)
        for size in (320, 512):
            pictures = folder / f"at-{size}"
            run("render", scene, pictures, "--views", VIEWS, "--size", size).check_returncode()
            row(f"rendered at {size} px", pictures)


if __name__ == "__main__":
    main()
