#!/usr/bin/env python3
"""Counts and times the kernels of a step of marking on a graphics card.

    python3 tools/gpu_profile.py target/release/guardsplat-worker SCENE KEY [--preset standard] [--steps 10,30] [--device wgpu]

Marks SCENE twice, with fewer and with more steps, while CubeCL logs each kernel that it launches, and prints what the
difference says of one step: launches and milliseconds by kind of kernel, as Markdown. Times are the device's own, with a
wait after each kernel, so they add up to more than a step without the log takes; that one's wall time is printed too.
"""
import argparse
import collections
import pathlib
import re
import subprocess
import tempfile
import time

LINE = re.compile(r"^\| ([0-9.]+)(ns|µs|ms|s)\s*\| ([\w:]+)")
UNITS = {"ns": 1e-6, "µs": 1e-3, "ms": 1.0, "s": 1e3}


def kind(path: str) -> str:
    """The part of a kernel's path that tells what it does."""
    parts = [part.strip(":") for part in path.split("::") if part.strip(":")]
    crate = parts[0].removeprefix("guardsplat_")
    return f"{crate}: {parts[-1]}"


def profile(command: list[str], steps: int, logged: bool) -> tuple[dict, float]:
    """Launches and milliseconds by kind of kernel of a whole job, and its seconds."""
    with tempfile.TemporaryDirectory() as folder:
        home = pathlib.Path(folder)
        (home / "settings.json").write_text(
            f'{{"steps": {steps}, "times_of_fine": 1, "times_of_parts": 1, "early_stop": null, "extension": null}}'
        )
        if logged:
            (home / "cubecl.toml").write_text(f'[profiling.logger]\nlevel = "full"\nfile = "{home}/kernels"\n')
        clock = time.monotonic()
        command = [*command, "--settings", str(home / "settings.json")]
        subprocess.run(command, cwd=home, check=False, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        seconds = time.monotonic() - clock
        found = collections.defaultdict(lambda: [0, 0.0])
        if logged:
            for line in open(home / "kernels", encoding="utf-8"):
                if match := LINE.match(line):
                    entry = found[kind(match[3])]
                    entry[0] += 1
                    entry[1] += float(match[1]) * UNITS[match[2]]
        return found, seconds


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("program", type=pathlib.Path)
    parser.add_argument("scene", type=pathlib.Path)
    parser.add_argument("key", type=pathlib.Path)
    parser.add_argument("--preset", default="standard")
    parser.add_argument("--steps", default="10,30", help="fewer, more")
    parser.add_argument("--device", default="wgpu")
    parser.add_argument("--message", default="c0ffee42")
    arguments = parser.parse_args()
    few, many = (int(steps) for steps in arguments.steps.split(","))
    with tempfile.TemporaryDirectory() as folder:
        command = [str(arguments.program.resolve()), "embed", str(arguments.scene.resolve()), f"{folder}/marked.ply"]
        command += ["--key", str(arguments.key.resolve()), "--message", arguments.message, "--preset", arguments.preset]
        command += ["--seed", "1", "--force", "--device", arguments.device]
        profile(command, few, False)  # Compiles what drivers keep.
        walls = [profile(command, steps, False)[1] for steps in (few, many)]
        counts = [profile(command, steps, True)[0] for steps in (few, many)]
    steps = many - few
    rows = []
    for name in counts[1]:
        launches, ms = ((counts[1][name][i] - counts[0][name][i]) / steps for i in (0, 1))
        rows.append((ms, launches, name))
    rows.sort(reverse=True)
    print("| kernel | launches a step | ms a step |\n|---|---|---|")
    for ms, launches, name in rows:
        if launches >= 0.05:
            print(f"| {name} | {launches:.1f} | {ms:.3f} |")
    print(f"| **all** | {sum(row[1] for row in rows):.1f} | {sum(row[0] for row in rows):.3f} |")
    print(f"\nWall time of a step without the log: {1e3 * (walls[1] - walls[0]) / steps:.1f} ms.")


if __name__ == "__main__":
    main()
