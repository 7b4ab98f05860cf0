#!/usr/bin/env bash
# Fuzzes everything that reads what a stranger may have written.
#
#     deploy/fuzz.sh [SECONDS a target (60)] [TARGET...]
#     deploy/fuzz.sh --build                              only builds
#     FUZZ_SEED=1 deploy/fuzz.sh 5                        tries the same inputs each time, as far as the time goes
#
# Own crates are built for it on stable Rust (deploy/fuzz-rustc.sh); cargo-fuzz and nightly are not needed. What is found
# on the way is kept in target/fuzz/corpus and goes on from there the next time; tests/fuzz/corpus is where it starts.
# docs/fuzzing.md tells what a report means. Ends with 1 when something was found.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

if ! command -v c++ >/dev/null; then
    echo "fuzz: the fuzzer is built with a C++ compiler, and there is none; Debian's package is g++" >&2
    exit 1
fi
only_build=''
[[ ${1:-} != --build ]] || { only_build=yes && shift; }
seconds=${1:-60}
shift $(($# > 0))
targets=("$@")
[[ ${#targets[@]} -gt 0 ]] || mapfile -t targets < <(cd tests/fuzz/fuzz_targets && printf '%s\n' *.rs | sed 's/\.rs$//')

# Each has its programs in a folder of its own, so that others of the same profile stay as they are.
built=${CARGO_TARGET_DIR:-target}/release
fuzz=${CARGO_TARGET_DIR:-target}/fuzz
programs=()
for target in "${targets[@]}"; do
    if [[ ! -f tests/fuzz/fuzz_targets/$target.rs ]]; then
        echo "$target is no target; tests/fuzz/fuzz_targets has them all" >&2
        exit 1
    fi
    programs+=(--bin "fuzz_$target")
done
echo "building ${#targets[@]} programs"
RUSTC_WORKSPACE_WRAPPER=$PWD/deploy/fuzz-rustc.sh \
    cargo build --release --workspace --locked --features guardsplat-fuzz/fuzzing "${programs[@]}"
[[ -z $only_build ]] || exit 0

mkdir -p "$fuzz/artifacts" "$fuzz/logs"

# One target; its log says the rest.
run() {
    local target=$1 dictionary=()
    mkdir -p "$fuzz/corpus/$target" "$fuzz/artifacts/$target"
    [[ -f tests/fuzz/dictionaries/$target.dict ]] && dictionary=("-dict=tests/fuzz/dictionaries/$target.dict")
    # Without leak detection: it is that of a sanitizer that is not there. Allocations are counted by the targets.
    "$built/fuzz_$target" "$fuzz/corpus/$target" "tests/fuzz/corpus/$target" "${dictionary[@]}" \
        -artifact_prefix="$fuzz/artifacts/$target/" -max_total_time="$seconds" -max_len=65536 -timeout=20 \
        -seed="${FUZZ_SEED:-0}" -rss_limit_mb=2048 -print_final_stats=1 -detect_leaks=0 -reload=0 >"$fuzz/logs/$target" 2>&1
}

# As many at a time as there are cores.
failed=()
declare -A running=()
reap() {
    local pid status=0
    wait -n -p pid "${!running[@]}" || status=$?
    [[ $status -eq 0 ]] || failed+=("${running[$pid]}")
    unset "running[$pid]"
}
trap 'kill "${!running[@]}" 2>/dev/null || true' EXIT
for target in "${targets[@]}"; do
    [[ ${#running[@]} -lt $(nproc) ]] || reap
    run "$target" &
    running[$!]=$target
done
while [[ ${#running[@]} -gt 0 ]]; do reap; done
trap - EXIT

# The last figure that a pattern finds in a log.
figure() {
    grep -oE "$1" "$2" | tail -n 1 | grep -oE '[0-9]+$' || echo 0
}
printf '%-16s %12s %9s %9s %8s %12s\n' target executions coverage features corpus 'peak bytes'
for target in "${targets[@]}"; do
    log=$fuzz/logs/$target
    printf '%-16s %12s %9s %9s %8s %12s\n' "$target" "$(figure 'stat::number_of_executed_units: *[0-9]+' "$log")" \
        "$(figure 'cov: [0-9]+' "$log")" "$(figure 'ft: [0-9]+' "$log")" "$(figure 'corp: [0-9]+' "$log")" \
        "$(figure 'peak: [0-9]+' "$log")"
done
for target in "${failed[@]}"; do
    echo
    echo "$target failed; the end of $fuzz/logs/$target:"
    grep -vE '^#[0-9]+' "$fuzz/logs/$target" | tail -n 20
    artifact=$(grep -oE 'Test unit written to .*' "$fuzz/logs/$target" | tail -n 1 | sed 's/^Test unit written to //')
    [[ -z $artifact ]] || echo "again: $built/fuzz_$target $artifact"
done
[[ ${#failed[@]} -eq 0 ]]
