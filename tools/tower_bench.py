#!/usr/bin/env python3
"""Times the image tower with its gradient against PyTorch, eager and compiled, in turns.

    cargo build --release --workspace --locked --examples
    python3 tools/tower_bench.py target/release/examples/bench_tower [--rounds 7] [--threads 2]

Needs PyTorch, safetensors, and a C++ compiler for torch.compile. Each round runs all three; what is printed is the median of rounds in
milliseconds, and the median of the rounds' ratios with their range.
"""

import argparse
import math
import os
import statistics
import subprocess
import time
from pathlib import Path

import torch

from twin.reading import Tower

VIEWS = 8
CLIP = Path(__file__).resolve().parent.parent / "crates/engine/models/guardsplat-2"


def milliseconds(tower, repeats: int = 3) -> float:
    """The fewest of some runs of features and gradient."""
    best = math.inf
    for _ in range(repeats):
        pictures = torch.rand(VIEWS, 3, tower.side, tower.side).requires_grad_()
        clock = time.perf_counter()
        tower(pictures).sum().backward()
        best = min(best, 1e3 * (time.perf_counter() - clock))
    return best


def engine(program: str, threads: int) -> float:
    """The same of the engine."""
    run = subprocess.run(
        [program, str(VIEWS), "3"],
        env={**os.environ, "RAYON_NUM_THREADS": str(threads)},
        capture_output=True,
        text=True,
        check=True,
    )
    lines = dict(line.split(maxsplit=1) for line in run.stdout.splitlines())
    return float(lines["forward_and_gradient_ms"])


def main() -> None:
    """Runs all in turns and prints a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--threads", type=int, default=2)
    options = parser.parse_args()
    torch.set_num_threads(options.threads)
    eager = Tower(CLIP)
    compiled = torch.compile(eager)
    runs = {
        "engine": lambda: engine(options.program, options.threads),
        "eager": lambda: milliseconds(eager),
        "compiled": lambda: milliseconds(compiled),
    }
    milliseconds(compiled)
    times = {name: [] for name in runs}
    for _ in range(options.rounds):
        for name, run in runs.items():
            times[name].append(run())
    print(f"PyTorch {torch.__version__}, {options.threads} threads, {options.rounds} rounds")
    for name, found in times.items():
        ratios = [theirs / ours for theirs, ours in zip(found, times["engine"])]
        print(
            f"{name:9} {statistics.median(found):7.1f} ms, {statistics.median(ratios):5.2f} times the engine's "
            f"({min(ratios):.2f} to {max(ratios):.2f})"
        )


if __name__ == "__main__":
    main()
