#!/usr/bin/env python3
"""Compares claims that count the bits of pictures with claims that weigh them: docs/verify.md, "How it is decided".

    pip install pillow numpy
    tools/robustness/counted_and_weighed.py WORKER SCENE KEY MESSAGE

WORKER is the program guardsplat-worker, SCENE a marked one. Renders six views, changes them, reads them as they are given,
and prints a row of docs/evaluation/signed-rank.csv for one picture and for three together. A match needs one in a million
with half of the rate, which pictures as given have. The test is written here once more, apart from the engine's.
"""
import json
import subprocess
import sys
import tempfile
from math import comb, log10
from pathlib import Path

import numpy
from PIL import Image

VIEWS, SIZE, SEED = 6, 800, 91
RATE = 5e-7


def changed(change):
    """A picture with its values changed, of which there is the number too."""

    def apply(picture, number):
        values = change(numpy.asarray(picture, float), number)
        return Image.fromarray(values.round().clip(0, 255).astype(numpy.uint8))

    return apply


def noise(values, number):
    return values + numpy.random.default_rng(number).normal(0, 25.5, values.shape)


def same(picture, _number):
    return picture


CHANGES = {
    "bright.9": (changed(lambda values, _: 0.9 * values), "png", {}),
    "bright.97": (changed(lambda values, _: 0.97 * values), "png", {}),
    "clean": (same, "png", {}),
    "crop4": (lambda picture, _: picture.crop((240, 240, 560, 560)), "png", {}),
    "jpeg10": (same, "jpg", {"quality": 10}),
    "jpeg20": (same, "jpg", {"quality": 20}),
    "jpeg30": (same, "jpg", {"quality": 30}),
    "noise.1": (changed(noise), "png", {}),
    "small": (lambda picture, _: picture.resize((300, 300), Image.LANCZOS), "jpg", {"quality": 60}),
    "webp40": (same, "webp", {"quality": 40}),
}


def counted(logits, wanted):
    """P(as many matches by chance)."""
    bits, matches = len(logits), int(((logits > 0) == wanted).sum())
    return sum(comb(bits, k) for k in range(matches, bits + 1)) / 2**bits


def weighed(logits, wanted):
    """P(as large a rank sum by chance)."""
    ranks = numpy.empty(len(logits), int)
    ranks[numpy.argsort(abs(logits), kind="stable")] = numpy.arange(1, len(logits) + 1)
    chance = numpy.ones(1)
    for rank in range(1, len(logits) + 1):
        chance = (numpy.append(chance, numpy.zeros(rank)) + numpy.append(numpy.zeros(rank), chance)) / 2
    return chance[ranks[(logits > 0) == wanted].sum() :].sum()


def read(worker, folder, key):
    command = [worker, "verify", folder, "--key", key, "--device", "cpu", "--json", "--logits"]
    # Without a message nothing is decided, and the exit code says so.
    return numpy.array(json.loads(subprocess.run(command, capture_output=True, check=False).stdout)["logits"])


def main():
    worker, scene, key, message = sys.argv[1:]
    wanted = numpy.array([digit == "1" for digit in f"{int(message, 16):0{4 * len(message)}b}"])
    with tempfile.TemporaryDirectory() as folder:
        views = Path(folder) / "views"
        render = [worker, "render", scene, views, "--views", str(VIEWS), "--size", str(SIZE), "--seed", str(SEED)]
        subprocess.run([*render, "--device", "cpu"], check=True, capture_output=True)
        pictures = [Image.open(path).convert("RGB") for path in sorted(views.glob("*.png"))]
        for name, (change, form, options) in CHANGES.items():
            shown = Path(folder) / name
            shown.mkdir()
            for number, picture in enumerate(pictures):
                change(picture, number).save(shown / f"{number}.{form}", **options)
            logits = read(worker, shown, key)
            for together in (1, 3):
                sums = [logits[i : i + together].sum(0) for i in range(0, VIEWS - together + 1, together)]
                right = 100 * numpy.mean([(s > 0) == wanted for s in sums])
                chances = [[test(s, wanted) for s in sums] for test in (counted, weighed)]
                medians = [f"{numpy.median([log10(p) for p in each]):.1f}" for each in chances]
                matches = [f"{numpy.mean([p <= RATE for p in each]):.2f}" for each in chances]
                print(",".join([Path(scene).name, name, str(together), f"{right:.1f}", *medians, *matches]), flush=True)


main()
