#!/usr/bin/env bash
# A worked example for websites: marks a scene that was just uploaded, before anybody else gets it.
#
#   deploy/hooks/upload.sh ASSET SCENE OUT MESSAGE
#
# ASSET is what the website calls the scene, SCENE the file as it was uploaded, OUT where the marked one belongs, and
# MESSAGE what to mark it with, in hexadecimal. The key is named by GUARDSPLAT_KEY, the server by GUARDSPLAT_SERVER.
# OUT.json gets the figures.
#
# It may be called as often as one likes for the same asset, at the same time too, and from several machines: the scene
# is marked once. Exits as `guardsplat embed` does: 0 marked, 3 target missed (OUT is not written), 1 anything else.
#
#   GUARDSPLAT_HOOK_TRY    a number; another one starts afresh for an asset whose job failed
set -euo pipefail

fail() {
    echo "upload hook: $*" >&2
    exit 1
}

[ $# -eq 4 ] || fail "wants ASSET SCENE OUT MESSAGE"
asset=$1 scene=$2 out=$3 message=$4
[ -n "$asset" ] || fail "the asset has no name"
[ -f "$scene" ] || fail "$scene is not a file"
key=${GUARDSPLAT_KEY:?upload hook: GUARDSPLAT_KEY must name the key}
try=${GUARDSPLAT_HOOK_TRY:-1}

# The same asset always gives the same UUID (version 8, which leaves its bits to us). The server knows by it a request
# that it has seen before, and refuses it with other bytes or another message.
digest=$(printf 'guardsplat upload hook\n%s\n%s' "$asset" "$try" | sha256sum)
request=${digest:0:8}-${digest:8:4}-8${digest:13:3}-8${digest:17:3}-${digest:20:12}

report=$out.json.$$
trap 'rm -f "$report"' EXIT
status=0
guardsplat --json embed --output="$out" --key="$key" --message="$message" --display-name="${asset:0:63}" \
    --request-id="$request" -- "$scene" >"$report" || status=$?
if grep -q '"REQUEST_ID_REUSED"' "$report"; then
    echo "upload hook: asset $asset was sent before with other bytes, another message or another key; a new version" \
        "needs a new name" >&2
fi
case $status in
    0 | 1 | 3) mv "$report" "$out.json" ;;
    # Killed, and nothing was said; the job goes on, and the next call finds it.
    *) fail "guardsplat ended with exit code $status" ;;
esac
exit "$status"
