#!/usr/bin/env bash
# A worked example of what `guardsplat hook s3` runs for each object: prints what to mark it with, in hexadecimal. Here
# the first part of the object's key is the number of its owner, as in `4711/castle.ply`, and the key has 32 bits. Without
# an owner nothing is printed, and the object is left alone.
#
#   guardsplat hook s3 --bucket uploads --folder /srv/uploads --key website -- deploy/hooks/message.sh
set -euo pipefail

owner=${GUARDSPLAT_OBJECT%%/*}
case $owner in
    "" | *[!0-9]*)
        echo "message hook: $GUARDSPLAT_OBJECT is in no owner's folder" >&2
        exit 0
        ;;
esac
# Ten digits at most, so that no shell takes it for something else.
[ "${#owner}" -le 10 ] && [ "$((10#$owner))" -le 4294967295 ] || {
    echo "message hook: there is no owner $owner" >&2
    exit 0
}
printf '%08x\n' "$((10#$owner))"
