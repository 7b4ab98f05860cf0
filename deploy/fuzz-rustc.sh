#!/usr/bin/env bash
# The compiler, for RUSTC_WORKSPACE_WRAPPER: own crates get LLVM's counters, which the fuzzer follows, and checks of
# arithmetic; their build scripts and macros, which run on this machine during the build, do not.
set -euo pipefail
rustc=$1
shift
previous='' crate=''
for argument in "$@"; do
    [[ $previous == --crate-name ]] && crate=$argument
    if [[ $previous == --crate-type && $argument == proc-macro || $argument == --crate-type=proc-macro ]]; then
        exec "$rustc" "$@"
    fi
    previous=$argument
done
# Without a name it is a question about the compiler.
if [[ -z $crate || $crate == ___ || $crate == build_script_* ]]; then
    exec "$rustc" "$@"
fi
exec "$rustc" "$@" \
    -C passes=sancov-module \
    -C llvm-args=-sanitizer-coverage-level=4 \
    -C llvm-args=-sanitizer-coverage-inline-8bit-counters \
    -C llvm-args=-sanitizer-coverage-pc-table \
    -C llvm-args=-sanitizer-coverage-trace-compares \
    -C debug-assertions=on -C overflow-checks=on
