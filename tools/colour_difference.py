#!/usr/bin/env python3
"""How far a marked scene's colours look from the original's (docs/evaluation/colour-difference.csv).

    pip install numpy pillow scikit-image
    tools/colour_difference.py WORKER ORIGINAL MARKED [SEED]

Ten views of 800 px of both are compared where the scene covers them, by CIEDE2000: pixel by pixel, and averaged over what
a viewer's eye takes together (a Gaussian of 4 pixels, about a tenth of a degree on a screen at arm's length). About
1 is just seen side by side, 2.3 is seen. Chroma says how colourful the original is there: on greys a tint shows most.
"""
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy
from PIL import Image
from skimage.color import deltaE_ciede2000, rgb2lab
from skimage.filters import gaussian


def views(worker, scene, folder, seed, *options):
    command = [worker, "render", scene, folder, "--views", "10", "--size", "800", "--seed", seed, *options]
    subprocess.run(command, check=True, capture_output=True)
    read = lambda path: numpy.asarray(Image.open(path).convert("RGB"), float) / 255
    return [read(path) for path in sorted(Path(folder).glob("view_*.png"))]


def seen(picture, covered):
    """The mean colour about each covered pixel, of covered ones."""
    weight = gaussian(covered.astype(float), 4)
    blurred = gaussian(picture * covered[..., None], 4, channel_axis=-1)
    return blurred / numpy.maximum(weight, 1e-6)[..., None]


def main(worker, original, marked, seed="0"):
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        kept = views(worker, original, f"{folder}/white", seed)
        black = views(worker, original, f"{folder}/black", seed, "--background", "black")
        shown = views(worker, marked, f"{folder}/marked", seed, "--cameras", f"{folder}/white/cameras.json")
    for before, over_black, after in zip(kept, black, shown):
        covered = numpy.abs(before - over_black).max(-1) < 0.1
        lab = rgb2lab(before)
        sharp = deltaE_ciede2000(lab, rgb2lab(after))[covered]
        soft = deltaE_ciede2000(rgb2lab(seen(before, covered)), rgb2lab(seen(after, covered)))[covered]
        chroma = numpy.hypot(lab[..., 1], lab[..., 2])[covered]
        rows.append([sharp.mean(), soft.mean(), numpy.percentile(soft, 95), chroma.mean()])
    mean = numpy.mean(rows, 0)
    print("scene,delta_e,delta_e_seen,delta_e_seen_95,chroma")
    print(Path(marked).name, *(f"{value:.2f}" for value in mean), sep=",")


if __name__ == "__main__":
    if len(sys.argv) not in (4, 5):
        sys.exit(__doc__)
    main(*sys.argv[1:])
