#!/usr/bin/env python3
"""Runs the steps of an embedding in PyTorch and in the engine: checks that both find the same loss, and times them in turns.

    cargo build --release --workspace --locked --examples
    python3 tools/step_bench.py target/release/examples/bench_step SCENE KEY [--rounds 7] [--steps 10] [--threads 2]

KEY is of 32 bits (`guardsplat-worker key create --bits 32 --seed 7 -o KEY`). Needs PyTorch, safetensors, and a C++ compiler for
torch.compile. Prints how far the losses are apart, then medians of rounds in milliseconds, by stage, and the median of the
rounds' ratios with their range. PyTorch runs twice: as it is, and with the loss compiled. The engine prepares views beside
the other stages, so its "prepare" is what it waits for them.
"""

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

import torch

from twin.step import Embedding, Loss
from twin.trace import Trace

MESSAGE = "c0ffee42"
CLIP = Path(__file__).resolve().parent.parent / "crates/engine/models/guardsplat-2"
NEAR = 1e-4
STAGES = ("step", "prepare", "draw", "loss", "backward", "optimiser")


def engine(options: argparse.Namespace, *arguments: str) -> dict[str, float]:
    """What the engine's program prints."""
    run = subprocess.run(
        [options.program, options.scene, options.key, MESSAGE, str(options.steps), *arguments],
        env={**os.environ, "RAYON_NUM_THREADS": str(options.threads)},
        capture_output=True,
        text=True,
        check=True,
    )
    lines = map(str.split, run.stdout.splitlines())
    return {name.removesuffix("_ms"): float(value) for name, value in lines}


def apart(trace: Trace, loss) -> torch.Tensor:
    """The largest differences of message, 1 - SSIM and L1 over the steps; relative where these are above 1."""
    embedding = Embedding(trace, loss)
    embedding.before(trace.steps)
    found = torch.stack([embedding.take(step) for step in trace.steps])
    expected = torch.stack([step.found for step in trace.steps])
    return ((found - expected).abs() / expected.clamp(min=1)).amax(0)


def twin(trace: Trace, loss) -> dict[str, float]:
    """Mean milliseconds of the steps, by stage."""
    embedding = Embedding(trace, loss)
    embedding.before(trace.steps)
    for step in trace.steps:
        embedding.take(step)
    stages = {stage: ms / len(trace.steps) for stage, ms in embedding.milliseconds.items()}
    return {"step": sum(stages.values()), **stages}


def main() -> None:
    """Checks, then runs all in turns and prints a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    parser.add_argument("scene")
    parser.add_argument("key")
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--steps", type=int, default=10)
    parser.add_argument("--threads", type=int, default=2)
    options = parser.parse_args()
    torch.set_num_threads(options.threads)
    with tempfile.TemporaryDirectory() as folder:
        path = f"{folder}/trace.safetensors"
        engine(options, path)
        trace = Trace(path)
    eager = Loss(trace, Path(options.key), CLIP)
    compiled = torch.compile(eager)
    for name, loss in [("PyTorch", eager), ("with its loss compiled", compiled)]:
        differences = apart(trace, loss)
        told = ", ".join(f"{part} {value:.1e}" for part, value in zip(("message", "1 - SSIM", "L1"), differences))
        print(f"{name}, {options.steps} steps: apart from the engine's loss by at most {told}")
        if differences.max() > NEAR:
            sys.exit(f"more than {NEAR}: these are not the same steps")
    runs = {
        "engine": lambda: engine(options),
        "PyTorch": lambda: twin(trace, eager),
        "compiled": lambda: twin(trace, compiled),
    }
    times = {name: [] for name in runs}
    for _ in range(options.rounds):
        for name, run in runs.items():
            times[name].append(run())
    print(f"PyTorch {torch.__version__}, {options.threads} threads, {options.rounds} rounds of {options.steps} steps")
    print("milliseconds a step   " + "".join(f"{stage:>10}" for stage in STAGES) + "   times the engine's")
    for name, found in times.items():
        medians = "".join(f"{statistics.median(run[stage] for run in found):10.1f}" for stage in STAGES)
        ratios = [theirs["step"] / ours["step"] for theirs, ours in zip(found, times["engine"])]
        print(f"{name:22}{medians}   {statistics.median(ratios):.2f} ({min(ratios):.2f} to {max(ratios):.2f})")


if __name__ == "__main__":
    main()
