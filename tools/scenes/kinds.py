#!/usr/bin/env python3
"""The kind that scenes are found to be, with the figures that say so, as CSV.

    tools/scenes/kinds.py WORKER SCENE... > kinds.csv

Runs `WORKER inspect --json` on each. Figures of views from around, the front and inside are empty where they were not needed.
"""
import csv
import json
import pathlib
import subprocess
import sys

FIGURES = ["hollow", "inside", "seen_from_front", "hidden_from_front", "hidden_from_behind", "seen_from_above", "flatness"]
FIGURES += ["spread", "surrounded"]
VIEWS = ["seen_from_around", "seen_from_front", "clear_from_around", "clear_from_inside"]


def main() -> None:
    worker, *scenes = sys.argv[1:]
    out = csv.writer(sys.stdout, lineterminator="\n")
    out.writerow(["scene", "gaussians", "kind", *FIGURES, *(f"views_{name}" for name in VIEWS)])
    for scene in scenes:
        told = json.loads(subprocess.run([worker, "inspect", scene, "--json"], check=True, capture_output=True).stdout)
        kind = told["kind"]
        views = kind.get("vantage") or {}
        figures = [kind[name] for name in FIGURES] + [views.get(name) for name in VIEWS]
        shown = ["" if figure is None else f"{figure:.3f}" for figure in figures]
        out.writerow([pathlib.Path(scene).name, told["gaussians"], kind["found"], *shown])


if __name__ == "__main__":
    main()
