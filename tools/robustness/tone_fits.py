#!/usr/bin/env python3
"""Ways to undo a filter with the unmarked original at hand: docs/verify.md, "With the original".

    tools/robustness/tone_fits.py WORKER ORIGINAL MARKED KEY MESSAGE PHOTOGRAPHS [--pictures N] [--seed S]

Held-out views of the marked scene are laid over photographs, given a filter and kept as JPEG 85. The camera is the true one.
The change of tones from the original to the picture is fitted as a polynomial, and what is left is read on white: as it is
(subtracted), or divided by the slope of the fit (undone). Prints right bits in percent as CSV, also for the filter itself in
place of a fit, which nobody knows. Needs numpy and Pillow.
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
from with_the_original import as_jpeg, filtered, laid_over, photograph

SIZE, COVERED, BEHIND, LARGEST = 800, 0.85, 0.05, 0.15


def saturated(picture, times):
    grey = (picture @ np.array([0.299, 0.587, 0.114]))[..., None]
    return np.clip(grey + times * (picture - grey), 0, 1)


def vivid(picture):
    strong = saturated(picture, 1.25)
    return strong + 0.6 * (strong - 0.5) * strong * (1 - strong)


def faded(picture):
    return 0.12 + 0.8 * saturated(picture, 0.8) ** 0.9 * np.array([1.03, 1.0, 0.94])


def mixed(picture):
    mix = np.array([[0.9, 0.12, -0.02], [0.05, 0.85, 0.08], [0.0, 0.1, 0.92]])
    return np.clip(picture @ mix.T, 0, 1) ** 1.1


FILTERS = {"bent channels": filtered, "vivid": vivid, "faded": faded, "mixed channels": mixed}


def quadratic(colours):
    r, g, b = colours.T
    return np.stack([np.ones_like(r), r, g, b, r * r, g * g, b * b, r * g, g * b, b * r], 1)


def fourth(colours):
    return np.concatenate([quadratic(colours), colours**3, colours**4], 1)


def cubic(colours):
    r, g, b = colours.T
    mixed = [r * r * g, r * r * b, g * g * r, g * g * b, b * b * r, b * b * g, r * g * b]
    return np.concatenate([quadratic(colours), colours**3, np.stack(mixed, 1)], 1)


# Terms, weight of no change a pixel, and whether the change is undone or only subtracted.
FITS = {
    "degree 2, 1e-3, subtracted": (quadratic, 1e-3, False),
    "degree 2, 1e-3": (quadratic, 1e-3, True),
    "degree 2, 1e-4": (quadratic, 1e-4, True),
    "degree 2, 1e-6": (quadratic, 1e-6, True),
    "degree 4 a channel, 1e-4": (fourth, 1e-4, True),
    "degree 3, 1e-4": (cubic, 1e-4, True),
    "degree 3, 1e-6": (cubic, 1e-6, True),
}


def compared(seen, white, black, fit, true_filter):
    """The original on white with what `seen` shows otherwise."""
    coverage = np.clip(1 - (white - black).mean(2), 0, 1)
    shown, beside = coverage >= COVERED, coverage <= BEHIND
    behind = seen[beside].mean(0) if beside.any() else np.zeros(3)
    share = coverage[shown][:, None]
    colours = black[shown] / share
    alone = (seen[shown] - (1 - share) * behind) / share
    if fit is None:
        change, undoes = (lambda c: true_filter(np.clip(c, 0, 1))), True
    else:
        terms, no_change, undoes = fit
        t = terms(colours)
        normal = t.T @ t + no_change * len(t) * np.eye(t.shape[1])
        solved = np.linalg.solve(normal, t.T @ (alone - colours))
        change = lambda c: c + terms(c) @ solved  # noqa: E731
    left = alone - change(colours)
    if undoes:
        steps = 0.01 * np.eye(3)
        slopes = np.stack([(change(colours + s) - change(colours - s)) / 0.02 for s in steps], 2)
        left = np.linalg.solve(slopes + 1e-3 * np.eye(3), left[..., None])[..., 0]
    out = white.copy()
    out[shown] += share * np.clip(left, -LARGEST, LARGEST)
    return out


def right_bits(worker, pictures, key, message):
    """Of each picture, read as given, the share of bits in percent."""
    with tempfile.TemporaryDirectory() as folder:
        for index, picture in enumerate(pictures):
            levels = (np.clip(picture, 0, 1) * 255 + 0.5).astype(np.uint8)
            Image.fromarray(levels).save(pathlib.Path(folder, f"{index:04}.png"))
        # Without a message nothing is compared, and nothing but the pictures as given is read.
        command = [worker, "verify", folder, "--key", key, "--device", "cpu", "--json", "--logits"]
        logits = np.array(json.loads(subprocess.run(command, capture_output=True, check=False).stdout)["logits"])
    word = np.unpackbits(np.frombuffer(bytes.fromhex(message), np.uint8))
    return 100 * ((logits > 0) == word).mean(1)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name in ("worker", "original", "marked", "key", "message", "photographs"):
        parser.add_argument(name)
    parser.add_argument("--pictures", type=int, default=3)
    parser.add_argument("--seed", type=int, default=92)
    given = parser.parse_args()
    name = pathlib.Path(given.original).name.split(".")[0]
    with tempfile.TemporaryDirectory() as folder:
        views = {
            (which, ground): rendered(
                given.worker, scene, pathlib.Path(folder, which), ground, given.pictures, SIZE, given.seed
            )
            for which, scene in (("original", given.original), ("marked", given.marked))
            for ground in ("white", "black")
        }
    print("scene,filter,fit,right_bits_percent")
    for filter_name, apply in FILTERS.items():
        read = {}
        for index in range(given.pictures):
            on_white, on_black = (views["marked", ground][index] for ground in ("white", "black"))
            over = laid_over(on_white, on_black, photograph(given.photographs, given.seed + index, SIZE))
            seen = np.asarray(Image.open(io.BytesIO(as_jpeg(apply(over), 85))), float) / 255
            for fit_name, fit in {"the filter itself": None, **FITS}.items():
                picture = compared(seen, views["original", "white"][index], views["original", "black"][index], fit, apply)
                read.setdefault(fit_name, []).append(picture)
        for fit_name, pictures in read.items():
            right = right_bits(given.worker, pictures, given.key, given.message).mean()
            print(f'{name},{filter_name},"{fit_name}",{right:.1f}', flush=True)


if __name__ == "__main__":
    main()
