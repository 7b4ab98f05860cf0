#!/usr/bin/env bash
# Marks a scene and recognises it, through the service: builds everything, starts a server with its worker, has a key
# made and a sample scene marked through the client, renders the scene before and after, verifies both, as scenes and as
# pictures, and stops the server.
#
#   deploy/quickstart.sh [--preset draft|standard|robust|thorough|paper] [--device auto|wgpu|cpu] [OUT]
#
# OUT is the folder for everything that is made, ./quickstart-out unless given; the server keeps its data in OUT/data.
# Exits with 0 when the marked scene is recognised and the unmarked one is not, and with 1 otherwise.
set -euo pipefail

usage() {
    sed -n '2,/^set /{/^#/s/^# \{0,1\}//p}' "${BASH_SOURCE[0]}"
}

preset=standard
device=auto
out=
while [ $# -gt 0 ]; do
    case $1 in
        --preset | --device)
            [ $# -ge 2 ] || { echo "quickstart: $1 needs a value" >&2; exit 1; }
            if [ "$1" = --preset ]; then preset=$2; else device=$2; fi
            shift 2
            ;;
        -h | --help) usage; exit 0 ;;
        -*) echo "quickstart: unknown option $1" >&2; usage >&2; exit 1 ;;
        *)
            [ -z "$out" ] || { echo "quickstart: one folder only, not $out and $1" >&2; exit 1; }
            out=$1
            shift
            ;;
    esac
done

case $preset in
    draft | standard | robust | thorough | paper) ;;
    *) echo "quickstart: $preset is not a preset, must be draft, standard, robust, thorough or paper" >&2; exit 1 ;;
esac
case $device in
    auto | wgpu | cpu) ;;
    *) echo "quickstart: $device is not a device, must be auto, wgpu or cpu" >&2; exit 1 ;;
esac

repository=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
mkdir -p "${out:=quickstart-out}"
out=$(cd "$out" && pwd)
cd "$repository"
source deploy/setup.sh

say() { printf '\n-- %s\n' "$*"; }

say "Setting up"
setup
say "Building (the first time takes a quarter of an hour or more on two cores)"
# All of the workspace, as the tests do: for fewer packages some dependencies would be built again.
cargo build --release --workspace --locked
programs=${CARGO_TARGET_DIR:-$repository/target}/release
worker=$programs/guardsplat-worker

message=c0ffee42
# Of another run; a stale file must not pass for a result of this one.
rm -rf "$out/marked.ply" "$out/comparison.png" "$out/views-unmarked" "$out/views-marked" "$out/server.address"

fail() {
    echo "quickstart: $*" >&2
    exit 1
}

say "A server with a worker of its own"
: >"$out/server.address"
"$programs/guardsplat-server" --listen 127.0.0.1:0 --data-dir "$out/data" --worker-device "$device" \
    >"$out/server.address" 2>"$out/server.log" &
server=$!
# However this ends, the server does too; it stops its worker.
stop_server() {
    local status=0
    [ -n "$server" ] || return 0
    kill "$server" 2>/dev/null || true
    wait "$server" || status=$?
    server=
    return "$status"
}
trap 'stop_server || true' EXIT
url=
for ((tries = 0; tries < 600; tries++)); do
    read -r _ _ url <"$out/server.address" && break
    kill -0 "$server" 2>/dev/null || break
    sleep 0.1
done
if [ -z "$url" ]; then
    tail -n 5 "$out/server.log" >&2
    fail "the server did not start"
fi
echo "listens on $url, logs to $out/server.log"
client() { "$programs/guardsplat" --server "$url" "$@"; }

say "A sample scene"
"$worker" sample "$out/scene.ply"
say "A key for messages of 32 bits; its secret stays with the server"
key=$(client key create --bits 32 --display-name quickstart) || fail "no key was made"
echo "$key"
# Before the semicolon stands its name.
key=${key%%;*}

say "Marking the scene with the message $message (preset $preset)"
# A sample is handed out even when its mark misses what the preset promises; whether it is recognised is seen below.
status=0
client embed "$out/scene.ply" -o "$out/marked.ply" --key "$key" --message "$message" --preset "$preset" --force \
    --comparison "$out/comparison.png" || status=$?
case $status in
    0) ;;
    3)
        echo "quickstart: the mark missed the target of the preset $preset, and without --force it would not have been" \
            "handed out. --preset standard takes longer and marks better." >&2
        ;;
    *) fail "marking failed" ;;
esac

say "Pictures of both scenes, as somebody else might render them"
"$worker" render "$out/scene.ply" "$out/views-unmarked" --views 5 --device "$device"
"$worker" render "$out/marked.ply" "$out/views-marked" --cameras "$out/views-unmarked/cameras.json" --device "$device"

say "Verdicts"
# Prints the verdict on one suspect in a line, and remembers whether it is the one expected.
surprises=0
expect() {
    local title=$1 expected=$2 suspect=$3 status=0 verdict
    verdict=$(client verify "$suspect" --key "$key" --message "$message" 2>>"$out/client.log") || status=$?
    [ "$status" -ne 1 ] || { tail -n 5 "$out/client.log" >&2; fail "verifying $suspect failed"; }
    printf '%-32s %s\n' "$title" "$verdict"
    if [ "$status" -ne "$expected" ]; then
        echo "quickstart: that is not the expected verdict (exit code $status instead of $expected)" >&2
        surprises=$((surprises + 1))
    fi
}
expect "marked scene" 0 "$out/marked.ply"
expect "pictures of the marked scene" 0 "$out/views-marked"
expect "unmarked scene" 2 "$out/scene.ply"
expect "pictures of the unmarked scene" 2 "$out/views-unmarked"

say "Stopping the server"
stop_server || fail "the server did not stop in good order; see $out/server.log"
cat <<END
unmarked scene   file://$out/scene.ply
marked scene     file://$out/marked.ply
side by side     file://$out/comparison.png (unmarked, marked, ten times the difference)
unmarked views   file://$out/views-unmarked
marked views     file://$out/views-marked
END
[ "$surprises" -eq 0 ] || fail "$surprises of 4 verdicts were not as expected"
echo "The marked scene is recognised, the unmarked one is not."
