#!/usr/bin/env python3
"""Times the image tower with its gradient against PyTorch, eager and compiled, in turns.

    cargo build --release --workspace --locked --examples
    python3 tools/tower_bench.py target/release/examples/bench_tower [--rounds 7] [--threads 2]

Needs PyTorch and a C++ compiler for torch.compile. Each round runs all three; what is printed is the median of rounds in
milliseconds, and the median of the rounds' ratios with their range.
"""
import argparse
import math
import os
import statistics
import subprocess
import time

import torch
from torch.nn import functional

VIEWS, SIDE, WIDTH, SCALES, FEATURES = 8, 160, 128, (1, 2, 4), 152


class Tower(torch.nn.Module):
    """Mean sines of filters of one pixel at three scales, and a linear head."""

    def __init__(self) -> None:
        super().__init__()
        generator = torch.Generator().manual_seed(1)
        draw = lambda *shape: torch.randn(*shape, generator=generator)
        self.filters = [20.0 * draw(WIDTH, 3) for _ in SCALES]
        self.phases = [math.pi * draw(WIDTH) for _ in SCALES]
        self.head = draw(WIDTH * len(SCALES), FEATURES) / WIDTH

    def forward(self, pictures: torch.Tensor) -> torch.Tensor:
        """Features of pictures [views, 3, side, side]."""
        means = []
        for scale, filters, phases in zip(SCALES, self.filters, self.phases):
            x = pictures if scale == 1 else functional.avg_pool2d(pictures, scale)
            angles = torch.einsum("nc,bcp->bnp", filters, x.flatten(2)) + phases[:, None]
            means.append(angles.sin().mean(2))
        return functional.normalize(torch.cat(means, 1) @ self.head)


def milliseconds(tower, repeats: int = 3) -> float:
    """The fewest of some runs of features and gradient."""
    best = math.inf
    for _ in range(repeats):
        pictures = torch.rand(VIEWS, 3, SIDE, SIDE).requires_grad_()
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
    eager = Tower()
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
