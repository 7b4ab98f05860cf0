#!/usr/bin/env bash
# The page in a real browser, with real servers and jobs: tests/page, with the programs that are built and Debian's
# Chromium. Says first whether server/page/vendor is what tools/page/vendor.sh makes.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
target=$(mkdir -p "${CARGO_TARGET_DIR:-target}" && cd "${CARGO_TARGET_DIR:-target}" && pwd)
tools=$target/python-for-tests-page
requirements=tests/page/requirements.txt

# Without a browser, npm or Python the checks are left out, unless CI is set.
unchecked() {
    echo "page: $1" >&2
    [ -z "${CI:-}" ]
    exit
}

for program in npm python3 chromium; do
    type -P "$program" >/dev/null || unchecked "$program was not found"
done
status=0
bash tools/page/vendor.sh --check || status=$?
[ "$status" -ne 3 ] || unchecked "what the page is made with could not be fetched from the npm registry"
[ "$status" -eq 0 ] || exit "$status"
# Written last: what was installed.
if ! cmp -s "$requirements" "$tools/installed.txt"; then
    { python3 -m venv --clear "$tools" &&
        "$tools/bin/pip" install --quiet --disable-pip-version-check --requirement "$requirements"; } ||
        unchecked "what tests need ($requirements) could not be fetched from PyPI"
    cp "$requirements" "$tools/installed.txt"
fi
"$tools/bin/ruff" check --quiet --line-length 120 tests/page
"$tools/bin/ruff" format --quiet --check --line-length 120 tests/page
CARGO_TARGET_DIR=$target "$tools/bin/pytest" -p no:cacheprovider --rootdir tests/page --quiet --durations 8 "$@" tests/page
