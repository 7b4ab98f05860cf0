#!/usr/bin/env bash
# Checks the protos with buf: style, and that nothing breaks callers of the released API, which is kept as an image in
# proto/released. buf comes from the npm registry once, pinned, and is kept below target/.
# After a release: deploy/check-api.sh --release makes the API as it stands the released one.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
target=$(mkdir -p "${CARGO_TARGET_DIR:-target}" && cd "${CARGO_TARGET_DIR:-target}" && pwd)
cd proto

VERSION=1.75.0
IMAGE=released/guardsplat.v1.binpb
tools=$target/buf-$VERSION
buf=$tools/node_modules/.bin/buf

if [ ! -x "$buf" ]; then
    if ! command -v npm >/dev/null; then
        echo "check-api: npm was not found, so buf can't be fetched; install Node.js to check the protos" >&2
        # Elsewhere the check is a convenience; in continuous integration a check that did not run is no check.
        if [ -n "${CI:-}" ]; then
            exit 1
        fi
        echo "check-api: skipped" >&2
        exit 0
    fi
    if ! npm install --loglevel=error --no-audit --no-fund --no-save --prefix "$tools" "@bufbuild/buf@$VERSION"; then
        echo "check-api: buf $VERSION could not be fetched from the npm registry" >&2
        exit 1
    fi
fi
case "${1:-}" in
    "")
        "$buf" lint
        "$buf" breaking --against "$IMAGE"
        echo "check-api: the protos are well-formed and break nothing"
        ;;
    --release)
        mkdir -p "$(dirname "$IMAGE")"
        "$buf" build --exclude-source-info -o "$IMAGE"
        echo "check-api: $IMAGE is the API as it stands"
        ;;
    *)
        echo "usage: deploy/check-api.sh [--release]" >&2
        exit 2
        ;;
esac
