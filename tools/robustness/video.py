#!/usr/bin/env python3
"""Reads frames of videos of a marked object: docs/evaluation.md, "Videos".

    apt-get install ffmpeg; pip install numpy
    tools/robustness/video.py WORKER SCENE KEY MESSAGE

WORKER is the program guardsplat-worker, SCENE a marked one. Renders a camera that goes a seventh of the way around it in 36
frames, encodes these, reads three frames that are no key frames together as a claim does, and prints a row of
docs/evaluation/video.csv for each encoder.
"""
import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy

SIZE, SEED = 800, 93
FRAMES, DEGREES = 36, 1.5
READ = 7, 19, 31
ENCODERS = {
    "H.264, CRF 23": ["-c:v", "libx264", "-crf", "23"],
    "H.264, CRF 30": ["-c:v", "libx264", "-crf", "30"],
    "H.264, CRF 36": ["-c:v", "libx264", "-crf", "36"],
    "H.265, CRF 28": ["-c:v", "libx265", "-crf", "28"],
    "VP9, CRF 35": ["-c:v", "libvpx-vp9", "-crf", "35", "-b:v", "0"],
}


def orbit(cameras):
    """The first camera, turned about its own up axis through the point that all look at."""
    positions = numpy.array([camera["position"] for camera in cameras])
    rotations = numpy.array([camera["rotation"] for camera in cameras])
    across = numpy.array([numpy.eye(3) - numpy.outer(forward, forward) for forward in rotations[:, :, 2]])
    middle = numpy.linalg.solve(across.sum(0), numpy.einsum("nij,nj->i", across, positions))
    x, y, z = rotations[0][:, 1]
    axis = numpy.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    for number in range(FRAMES):
        angle = numpy.radians(DEGREES * number)
        turn = numpy.eye(3) + numpy.sin(angle) * axis + (1 - numpy.cos(angle)) * axis @ axis
        turned = {
            "id": number,
            "img_name": f"{number:03}",
            "position": (middle + turn @ (positions[0] - middle)).tolist(),
            "rotation": (turn @ rotations[0]).tolist(),
        }
        yield cameras[0] | turned


def run(*command):
    return subprocess.run([str(part) for part in command], check=True, capture_output=True)


def main():
    worker, scene, key, message = sys.argv[1:]
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        options = ["--size", SIZE, "--device", "cpu"]
        run(worker, "render", scene, folder / "views", "--views", 3, "--seed", SEED, *options)
        cameras = json.loads((folder / "views/cameras.json").read_text())
        (folder / "orbit.json").write_text(json.dumps(list(orbit(cameras))))
        run(worker, "render", scene, folder / "orbit", "--cameras", folder / "orbit.json", *options)
        for name, encoder in ENCODERS.items():
            shown = folder / name.replace(" ", "-")
            shown.mkdir()
            video = shown / "video.mkv"
            ffmpeg = ["ffmpeg", "-loglevel", "error", "-y"]
            run(*ffmpeg, "-framerate", 25, "-i", folder / "orbit/view_%03d.png", *encoder, "-pix_fmt", "yuv420p", video)
            chosen = "+".join(f"eq(n\\,{frame})" for frame in READ)
            run(*ffmpeg, "-i", video, "-vf", f"select='{chosen}'", "-fps_mode", "passthrough", shown / "%d.png")
            command = [worker, "verify", shown, "--key", key, "--message", message, "--device", "cpu", "--json"]
            # The exit code says whether it matched.
            told = json.loads(subprocess.run(command, capture_output=True, check=False).stdout)
            right, size = f"{100 * told['bit_accuracy']:.1f}", round(8 * video.stat().st_size * 25 / FRAMES / 1000)
            row = [Path(scene).name, f'"{name}"', size, told["matched_bits"], told["bits"], right, f"{told['p_value']:.1e}"]
            print(",".join(map(str, [*row, told["verdict"]])), flush=True)


main()
