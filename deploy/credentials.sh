#!/usr/bin/env bash
# Content credentials: builds guardsplat-credentials beside the other programs, runs its tests, and has a second reader, the
# C2PA's Python library, validate what the worker writes, and has jobs of a server write it, too. The worker must be built.
#
#     deploy/credentials.sh          all of that
#     deploy/credentials.sh build    the program only
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
target=$(mkdir -p "${CARGO_TARGET_DIR:-target}" && cd "${CARGO_TARGET_DIR:-target}" && pwd)
tools=$target/credentials-for-tests
requirements=credentials/tests/requirements.txt
own=(--release --locked --manifest-path credentials/Cargo.toml --target-dir "$target")

cargo build --quiet "${own[@]}"
[ "${1:-}" != build ] || exit 0
cargo fmt --check --manifest-path credentials/Cargo.toml
cargo clippy --quiet "${own[@]}" --all-targets -- -D warnings
cargo test --quiet "${own[@]}"

# Without Python, or without PyPI, the second reader is left out, unless CI is set.
unchecked() {
    echo "credentials: $1" >&2
    [ -z "${CI:-}" ]
    exit
}
[ -x "$target/release/guardsplat-worker" ] || unchecked "guardsplat-worker is not built"
# Jobs of a server. Without the program these tests are skipped.
GUARDSPLAT_CREDENTIALS_BUILT=1 CARGO_TARGET_DIR=$target \
    cargo test --quiet --release --workspace --locked --test service -- credentials
if ! cmp -s "$requirements" "$tools/installed.txt"; then
    command -v python3 >/dev/null || unchecked "python3 was not found"
    { python3 -m venv --clear "$tools" &&
        "$tools/bin/pip" install --quiet --disable-pip-version-check --requirement "$requirements"; } ||
        unchecked "what tests need ($requirements) could not be fetched from PyPI"
    cp "$requirements" "$tools/installed.txt"
fi
GUARDSPLAT_PROGRAMS=$target/release "$tools/bin/pytest" --quiet -p no:cacheprovider credentials/tests
