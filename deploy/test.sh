#!/usr/bin/env bash
# Checks everything: formatting, protos, lints, all tests, and a little fuzzing. CONTRIBUTING.md says how long that takes.
# Scenes for the tests that want real ones are taken from $GUARDSPLAT_SCENES or ../shared/scenes; without them those
# tests are skipped, unless CI is set.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
source deploy/setup.sh

# A clone that is built once gains nothing from pieces that are kept for the next build, and pays for them.
[ -z "${CI:-}" ] || export CARGO_INCREMENTAL=0
# Examples are benchmarks, which the lints compile too; there are no tests in documentation.
kinds=(--lib --bins --tests)

# Runs a stage and tells how long it took.
stage() {
    local title=$1 start=$SECONDS
    shift
    echo "== $title"
    "$@"
    echo "== $title: $((SECONDS - start)) s"
}

# All tests, then their number in one line; a run without any is a failure.
run_tests() {
    local output
    output=$(mktemp)
    local status=0
    cargo test --release --workspace --locked "${kinds[@]}" --no-fail-fast 2>&1 | tee "$output" || status=$?
    awk '/^test result:/ { passed += $4; failed += $6; ignored += $8 }
         END { printf "%d passed, %d failed, %d skipped\n", passed, failed, ignored; exit passed == 0 }' "$output" || status=1
    rm -f "$output"
    return "$status"
}

# What Grafana, Prometheus and KEDA are to ask, read as Prometheus does.
check_queries() {
    local tool=(--locked --manifest-path tools/promql/Cargo.toml --target-dir "${CARGO_TARGET_DIR:-target}/promql")
    cargo test --quiet "${tool[@]}"
    cargo run --quiet "${tool[@]}" -- deploy/monitoring/{dashboard.json,alerts.yaml} deploy/kubernetes/scaling.yaml
}

# Tests wait for servers and timers half of the time. Meanwhile is built what later stages need, and lints look at all of it,
# at low priority: they share build scripts and macros with the build, and nothing else.
start_building_beside() {
    beside_log=$(mktemp)
    # Cargo looks whether the tests are built before it runs them, and builds nothing else meanwhile: they come first.
    # A group of its own, so that nothing of it is left behind.
    setsid nice -n 15 bash -c 'sleep 30 && bash deploy/fuzz.sh --build && bash deploy/credentials.sh build &&
        cargo clippy --release --workspace --all-targets --locked -- -D warnings' >"$beside_log" 2>&1 &
    beside=$!
    trap 'kill -- "-$beside" 2>/dev/null || true; rm -f "$beside_log"' EXIT
}

finish_building_beside() {
    wait "$beside" && return
    cat "$beside_log"
    return 1
}

# Both wait for servers, an interpreter and a browser most of the time.
check_python_and_page() {
    local page_log python page status=0
    page_log=$(mktemp)
    # In shells of their own, where a command that fails ends them.
    (TARGETS_BUILT="${kinds[*]}" stage python bash deploy/python.sh) &
    python=$!
    (stage page bash deploy/page.sh) >"$page_log" 2>&1 &
    page=$!
    wait "$python" || status=$?
    wait "$page" || status=$?
    cat "$page_log"
    rm -f "$page_log"
    return "$status"
}

stage setup setup
stage "setup of tests" setup_tests
for tool in fmt clippy; do
    if ! cargo "$tool" --version >/dev/null 2>&1; then
        echo "cargo $tool was not found; rustup component add rustfmt clippy" >&2
        exit 1
    fi
done
# What fails fastest comes first. One profile serves the tests and the quickstart, so that no dependency is built twice.
stage formatting cargo fmt --all --check
stage protos bash deploy/check-api.sh
stage queries check_queries
stage dependencies bash deploy/check-dependencies.sh
stage build cargo test --release --workspace --locked "${kinds[@]}" --no-run
start_building_beside
stage tests run_tests
stage "build and lints beside the tests" finish_building_beside
stage "python and page" check_python_and_page
stage credentials bash deploy/credentials.sh
# Longer runs, and other inputs, are for people: docs/fuzzing.md.
stage fuzz env FUZZ_SEED=1 bash deploy/fuzz.sh 5
echo "== all: $SECONDS s"
