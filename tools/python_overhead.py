"""What the Python package costs: the same job by the worker's program and by the package, in turns.

    target/python-for-tests-package/bin/python tools/python_overhead.py [TIMES [GAUSSIANS]]

After deploy/python.sh. Tells wall seconds and processor seconds of whole processes, starting them included.
"""

import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

WORKER = Path(os.environ.get("CARGO_TARGET_DIR", "target")).resolve() / "release/guardsplat-worker"
BY_PYTHON = """
import sys, guardsplat
guardsplat.embed(sys.argv[1], sys.argv[2], key=sys.argv[3], message="c0ffee42", device="cpu", force=True, progress=lambda event: None)
"""


def timed(command):
    start = time.monotonic()
    process = subprocess.Popen(list(map(str, command)), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    assert status == 0, command
    return time.monotonic() - start, usage.ru_utime + usage.ru_stime


times = int(sys.argv[1]) if len(sys.argv) > 1 else 3
gaussians = sys.argv[2] if len(sys.argv) > 2 else "30000"
with tempfile.TemporaryDirectory() as folder:
    scene, key, by_worker, by_python = (Path(folder) / name for name in ("scene.ply", "my.key", "w.ply", "p.ply"))
    subprocess.run([WORKER, "sample", scene, "--gaussians", gaussians], check=True, capture_output=True)
    make_key = [WORKER, "key", "create", "--bits", "32", "--seed", "7", "--device", "cpu", "-o", key]
    subprocess.run(make_key, check=True, capture_output=True)
    options = ["--key", key, "--message", "c0ffee42", "--device", "cpu", "--force", "--json"]
    runs = {
        "worker": [WORKER, "embed", scene, by_worker, *options],
        "python": [sys.executable, "-c", BY_PYTHON, scene, by_python, key],
    }
    found = {name: [] for name in runs}
    for _ in range(times):
        for name, command in runs.items():
            found[name].append(timed(command))
            print(name, "wall {:.2f} s, processor {:.2f} s".format(*found[name][-1]), flush=True)
    assert by_worker.read_bytes() == by_python.read_bytes()
for place, what in enumerate(("wall", "processor")):
    worker, python = (statistics.median(run[place] for run in found[name]) for name in runs)
    print(f"{what}: {worker:.2f} s and {python:.2f} s, {100 * (python / worker - 1):+.1f} %")
