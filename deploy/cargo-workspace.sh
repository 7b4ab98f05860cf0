#!/usr/bin/env bash
# In the place of cargo for maturin (deploy/python.sh): where that builds the one package it packs, all of the workspace is
# built instead, with the features that everything else is built with. Else burn would be built a second time, with fewer.
set -euo pipefail
if [ "${1:-}" != rustc ]; then
    exec cargo "$@"
fi
# maturin tells build scripts which Python it found; the stable interface is the same for all, and another environment
# would be another build.
unset PYO3_PYTHON PYO3_CONFIG_FILE PYO3_ENVIRONMENT_SIGNATURE PYO3_BUILD_EXTENSION_MODULE CARGO_ENCODED_RUSTFLAGS
exec cargo build --release --workspace --locked --message-format json-render-diagnostics
