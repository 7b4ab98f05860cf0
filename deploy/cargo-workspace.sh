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
# TARGETS_BUILT is what the caller has built, all programs unless given: with tests, some dependencies have more features.
# shellcheck disable=SC2086
exec cargo build --release --workspace --locked ${TARGETS_BUILT:-} --message-format json-render-diagnostics
