#!/usr/bin/env python3
"""Reads a marked scene's pictures after forty changes that photo programs and sites make: docs/evaluation.md, "Filters".

    pip install pillow numpy
    tools/robustness/scan.py WORKER SCENE KEY MESSAGE

WORKER is the program guardsplat-worker, SCENE a marked one. Renders three views, changes them, reads them together as a
claim does, and prints a row of docs/evaluation/scan.csv a change. The changes share no code with those of `evaluate`.
"""
import io
import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy
from PIL import Image, ImageDraw, ImageEnhance, ImageFilter, ImageOps

VIEWS, SIZE, SEED = 3, 800, 93
GROUND = (255, 255, 255)


def values(change):
    """A picture whose values of [0, 1] are changed."""

    def apply(picture):
        changed = change(numpy.asarray(picture, float) / 255)
        return Image.fromarray((255 * changed).round().clip(0, 255).astype(numpy.uint8))

    return apply


def enhanced(kind, factor):
    return lambda picture: kind(picture).enhance(factor)


def filtered(kind):
    return lambda picture: picture.filter(kind)


def times(*factors):
    return values(lambda v: v * factors)


def curve(bend):
    return values(lambda v: v - bend * numpy.sin(2 * numpy.pi * v) / (2 * numpy.pi))


def hue(degrees):
    def apply(picture):
        turned = numpy.array(picture.convert("HSV"))
        turned[..., 0] = (turned[..., 0].astype(int) + round(degrees * 256 / 360)) % 256
        return Image.fromarray(turned, "HSV").convert("RGB")

    return apply


def laid_over(colour, share):
    return lambda picture: Image.blend(picture, Image.new("RGB", picture.size, colour), share)


def palette(dither):
    return lambda picture: picture.quantize(256, dither=dither).convert("RGB")


def resized(*sides):
    def apply(picture):
        for side in sides:
            picture = picture.resize((side, side))
        return picture

    return apply


def jpeg(picture, quality):
    file = io.BytesIO()
    picture.save(file, "JPEG", quality=quality)
    return Image.open(file).convert("RGB")


def perspective(picture):
    width, height = picture.size
    k = 0.06
    corners = (1, k, -k * width / 2, 0, 1 + k, -k * height / 2, 0, k / height)
    return picture.transform(picture.size, Image.PERSPECTIVE, corners, Image.BICUBIC, fillcolor=GROUND)


def sheared(picture):
    return picture.transform(picture.size, Image.AFFINE, (1, 0.08, -30, 0, 1, 0), Image.BICUBIC, fillcolor=GROUND)


def written_over(picture):
    picture = picture.copy()
    draw = ImageDraw.Draw(picture)
    for y in range(40, picture.size[1], 160):
        draw.text((30, y), "SAMPLE  PREVIEW  SAMPLE  PREVIEW", fill=(128, 128, 128), font_size=40)
    return picture


def sepia(picture):
    return Image.blend(picture, ImageOps.colorize(picture.convert("L"), (20, 10, 0), (255, 240, 192)), 0.2)


def salt_and_pepper(picture):
    random = numpy.random.default_rng(5)
    salted = numpy.array(picture)
    hit = random.random(salted.shape[:2]) < 0.01
    salted[hit] = random.choice([0, 255], (hit.sum(), 1))
    return Image.fromarray(salted)


CHANGES = {
    "none": lambda picture: picture,
    "median 3": filtered(ImageFilter.MedianFilter(3)),
    "median 5": filtered(ImageFilter.MedianFilter(5)),
    "sharpened": filtered(ImageFilter.SHARPEN),
    "unsharp mask": filtered(ImageFilter.UnsharpMask(3, 120, 2)),
    "blur 3": filtered(ImageFilter.GaussianBlur(3)),
    "hue 5 degrees": hue(5),
    "hue 10 degrees": hue(10),
    "palette dithered": palette(Image.Dither.FLOYDSTEINBERG),
    "palette": palette(Image.Dither.NONE),
    "5 bits": lambda picture: ImageOps.posterize(picture, 5),
    "4 bits": lambda picture: ImageOps.posterize(picture, 4),
    "400 px and back": resized(400, 800),
    "200 px and back": resized(200, 800),
    "600 px nearest": lambda picture: picture.resize((600, 600), Image.NEAREST),
    "JPEG twice": lambda picture: jpeg(jpeg(picture, 85).resize((700, 700)), 80),
    "perspective": perspective,
    "sheared": sheared,
    "written over": written_over,
    "salt and pepper": salt_and_pepper,
    "grey over it": laid_over((128, 128, 128), 0.1),
    "black over it": laid_over((0, 0, 0), 0.1),
    "haze": laid_over((200, 210, 255), 0.15),
    "contrast 0.7": enhanced(ImageEnhance.Contrast, 0.7),
    "contrast 1.3": enhanced(ImageEnhance.Contrast, 1.3),
    "brightness 0.6": enhanced(ImageEnhance.Brightness, 0.6),
    "brightness 1.3": enhanced(ImageEnhance.Brightness, 1.3),
    "saturation 0.6": enhanced(ImageEnhance.Color, 0.6),
    "saturation 1.4": enhanced(ImageEnhance.Color, 1.4),
    "warm": times(1.1, 1, 0.9),
    "cool": times(0.9, 1, 1.1),
    "curve 0.3": curve(0.3),
    "curve 0.6": curve(0.6),
    "sepia": sepia,
    "levels of channels": ImageOps.autocontrast,
    "levels of all": lambda picture: ImageOps.autocontrast(picture, cutoff=1, preserve_tone=True),
    "equalised": ImageOps.equalize,
    "grey": lambda picture: picture.convert("L").convert("RGB"),
    "negative": ImageOps.invert,
}


def main():
    worker, scene, key, message = sys.argv[1:]
    with tempfile.TemporaryDirectory() as folder:
        views = Path(folder) / "views"
        render = [worker, "render", scene, views, "--views", str(VIEWS), "--size", str(SIZE), "--seed", str(SEED)]
        subprocess.run([*render, "--device", "cpu"], check=True, capture_output=True)
        pictures = [Image.open(path).convert("RGB") for path in sorted(views.glob("*.png"))]
        for name, change in CHANGES.items():
            shown = Path(folder) / name.replace(" ", "-")
            shown.mkdir()
            for number, picture in enumerate(pictures):
                change(picture).save(shown / f"{number}.png")
            command = [worker, "verify", shown, "--key", key, "--message", message, "--device", "cpu", "--json"]
            # The exit code says whether it matched.
            told = json.loads(subprocess.run(command, capture_output=True, check=False).stdout)
            row = [Path(scene).name, name, told["matched_bits"], told["bits"], f"{told['p_value']:.1e}", told["verdict"]]
            print(",".join(map(str, row)), flush=True)


main()
