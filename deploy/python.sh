#!/usr/bin/env bash
# The Python package: builds its wheel from what the workspace is built as, so that nothing is built twice, installs it into
# an environment of its own below target/, checks style and types and runs its tests.
#
#     deploy/python.sh              all of that
#     deploy/python.sh wheel DIR    a wheel to hand out
#     deploy/python.sh protos       generates python/guardsplat/v1 from the protos anew
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
target=$(mkdir -p "${CARGO_TARGET_DIR:-target}" && cd "${CARGO_TARGET_DIR:-target}" && pwd)
tools=$target/python-for-tests-package
requirements=python/tests/requirements.txt

# Without Python, or without PyPI, the checks are left out, unless CI is set.
unchecked() {
    echo "python: $1" >&2
    [ -z "${CI:-}" ]
    exit
}

# An environment with what builds and tests the package. Written last: what was installed.
if ! cmp -s "$requirements" "$tools/installed.txt"; then
    command -v python3 >/dev/null || unchecked "python3 was not found"
    { python3 -m venv --clear "$tools" &&
        "$tools/bin/pip" install --quiet --disable-pip-version-check --requirement "$requirements"; } ||
        unchecked "what tests need ($requirements) could not be fetched from PyPI"
    cp "$requirements" "$tools/installed.txt"
fi
if [ "${1:-}" = protos ]; then
    cd proto
    "$tools/bin/python" -m grpc_tools.protoc -I . --python_out=../python --pyi_out=../python \
        guardsplat/v1/{artifact_service,job,job_service,key_service,registry_service}.proto
    exit
fi
maturin=("$tools/bin/maturin" build --quiet --release --locked --manifest-path python/Cargo.toml)

if [ "${1:-}" = wheel ]; then
    CARGO="$PWD/deploy/cargo-workspace.sh" "${maturin[@]}" --out "${2:?the folder to write to}"
    exit
fi

rm -rf "$target/python-wheel"
# One that is thrown away need not be small.
CARGO="$PWD/deploy/cargo-workspace.sh" "${maturin[@]}" --compression-level 1 --out "$target/python-wheel"
"$tools/bin/pip" install --quiet --disable-pip-version-check --force-reinstall --no-deps "$target/python-wheel"/*.whl
"$tools/bin/ruff" check --quiet python tools/python_overhead.py
"$tools/bin/ruff" format --quiet --check python
(cd python && "$tools/bin/mypy")
CARGO_TARGET_DIR=$target "$tools/bin/pytest" --config-file python/pyproject.toml --quiet python/tests
