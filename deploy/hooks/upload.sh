#!/usr/bin/env bash
# A worked example for websites: marks a scene that was just uploaded, before anybody else gets it.
#
#   deploy/hooks/upload.sh ASSET SCENE OUT MESSAGE
#
# ASSET is what the website calls the scene, SCENE the file as it was uploaded, OUT where the marked one belongs, and
# MESSAGE what to mark it with, in hexadecimal. The key is named by GUARDSPLAT_KEY, the server by GUARDSPLAT_SERVER.
# OUT.json gets the figures.
#
# It may be called as often as one likes for the same asset, at the same time too: the scene is sent once and marked
# once. Exits as `guardsplat embed` does: 0 marked, 3 target missed (OUT is not written), 1 anything else.
#
#   GUARDSPLAT_HOOK_STATE  where it keeps what it has sent, ./guardsplat-hook unless set
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
state=${GUARDSPLAT_HOOK_STATE:-./guardsplat-hook}
try=${GUARDSPLAT_HOOK_TRY:-1}
mkdir -p "$state"

sha256() { sha256sum | cut -c 1-64; }

# The same asset always gives the same UUID (version 8, which leaves its bits to us), so the server knows a request that
# it has seen before.
digest=$(printf 'guardsplat upload hook\n%s\n%s' "$asset" "$try" | sha256)
request=${digest:0:8}-${digest:8:4}-8${digest:13:3}-8${digest:17:3}-${digest:20:12}

# One at a time for each asset; the lock goes with the process, however that ends.
exec 9>"$state/$request.lock"
flock 9

# A request is the same only if it names the same artifact, so what was sent is written down before it is used.
content=$(sha256 <"$scene")
sent=$state/$request.sent
if [ ! -f "$sent" ]; then
    artifact=$(guardsplat artifact put "$scene")
    printf '%s %s\n' "$artifact" "$content" >"$sent.part"
    mv "$sent.part" "$sent"
fi
read -r artifact known <"$sent"
[ "$known" = "$content" ] || fail "asset $asset was sent before with other bytes; a new version needs a new name"

status=0
guardsplat --json embed "$artifact" -o "$out" --key "$key" --message "$message" --display-name "${asset:0:63}" \
    --request-id "$request" >"$out.json.part" || status=$?
mv "$out.json.part" "$out.json"
exit "$status"
