#!/usr/bin/env python3
"""Single pictures of a marked scene over photographs, read without and with the unmarked original.

with_the_original.py WORKER ORIGINAL MARKED KEY MESSAGE PHOTOGRAPHS [--pictures N] [--seed S] [--size PX] [--only WORD]

Held-out views of the marked scene are rendered over white and over black, and laid over photographs of the folder
PHOTOGRAPHS. Each is changed in the ways of CHANGES, written, and given to `verify` by itself: once as it is, and once with
`--original`. Prints CSV: the verdict, the right bits, and the seconds of both, and how much of the picture the original
explains. Needs numpy and Pillow.
"""
import argparse
import io
import json
import pathlib
import subprocess
import tempfile

import numpy as np
from backdrops import rendered
from PIL import Image


def filtered(picture):
    """Black lifted, and each channel bent another way, as filters of phones do."""
    bent = np.clip(picture, 0, 1) ** np.array([0.8, 1.0, 1.2], np.float32)
    return 0.9 * bent + np.array([0.05, 0.025, 0.0], np.float32)


def cropped(picture):
    """A window of 0.7 of the sides, not in the middle."""
    side = picture.shape[0]
    top, left, kept = int(0.1 * side), int(0.22 * side), int(0.7 * side)
    return picture[top : top + kept, left : left + kept]


CHANGES = {
    "photograph, JPEG 80": (lambda picture: picture, 80),
    "photograph, JPEG 30": (lambda picture: picture, 30),
    "photograph, filter, JPEG 85": (filtered, 85),
    "photograph, cropped to 0.7, JPEG 80": (cropped, 80),
}


def photograph(folder, index, size):
    """The middle of a photograph, square."""
    files = sorted(file for file in pathlib.Path(folder).iterdir() if file.suffix in (".jpg", ".png"))
    picture = Image.open(files[index % len(files)]).convert("RGB")
    side = min(picture.size)
    left, top = (picture.width - side) // 2, (picture.height - side) // 2
    square = picture.crop((left, top, left + side, top + side)).resize((size, size), Image.LANCZOS)
    return np.asarray(square, np.float32) / 255


def laid_over(on_white, on_black, behind):
    """A view over a picture, of what it is over white and over black."""
    return on_black + np.clip(on_white - on_black, 0, 1) * behind


def as_jpeg(picture, quality):
    """Its bytes."""
    buffer = io.BytesIO()
    levels = (np.clip(picture, 0, 1) * 255 + 0.5).astype(np.uint8)
    Image.fromarray(levels).save(buffer, "JPEG", quality=quality)
    return buffer.getvalue()


def verified(worker, picture, key, message, *more):
    """What `verify` says; it exits with 2 where there is no match."""
    command = [worker, "verify", picture, "--key", key, "--message", message, "--device", "cpu", "--json", *more]
    return json.loads(subprocess.run(command, capture_output=True, check=False).stdout)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name in ("worker", "original", "marked", "key", "message", "photographs"):
        parser.add_argument(name)
    parser.add_argument("--pictures", type=int, default=3)
    parser.add_argument("--seed", type=int, default=93)
    parser.add_argument("--size", type=int, default=800)
    parser.add_argument("--only", default="", help="changes with this word")
    given = parser.parse_args()
    name = pathlib.Path(given.original).name.split(".")[0]
    print(
        "scene,change,picture,verdict,right_bits,seconds,"
        "verdict_with_original,right_bits_with_original,seconds_with_original,explained,bits"
    )
    with tempfile.TemporaryDirectory() as folder:
        white, black = (
            rendered(given.worker, given.marked, folder, ground, given.pictures, given.size, given.seed)
            for ground in ("white", "black")
        )
        for index, (on_white, on_black) in enumerate(zip(white, black)):
            over = laid_over(on_white, on_black, photograph(given.photographs, given.seed + index, given.size))
            for change, (changed, quality) in CHANGES.items():
                if given.only not in change:
                    continue
                file = pathlib.Path(folder, "suspect.jpg")
                file.write_bytes(as_jpeg(changed(over), quality))
                blind = verified(given.worker, file, given.key, given.message)
                found = verified(given.worker, file, given.key, given.message, "--original", given.original)
                told = [blind["verdict"], blind["matched_bits"], round(blind["seconds"], 1)]
                explained = found.get("explained_by_original", [None])[0]
                told += [found["verdict"], found["matched_bits"], round(found["seconds"], 1)]
                told += ["" if explained is None else round(explained, 3), found["bits"]]
                print(",".join(map(str, [name, f'"{change}"', index, *told])), flush=True)


if __name__ == "__main__":
    main()
