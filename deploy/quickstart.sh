#!/usr/bin/env bash
# Marks a scene and recognises it: builds the worker, makes a sample scene and a key, embeds a message, renders the
# scene before and after, and reads both.
#
#   deploy/quickstart.sh [--preset draft|standard|paper] [--device auto|wgpu|cpu] [OUT]
#
# OUT is the folder for everything that is made, ./quickstart-out unless given. Exits with 0 when the marked scene is
# recognised and the unmarked one is not, with 3 when the mark missed its target, and with 1 otherwise.
set -euo pipefail

usage() {
    sed -n '2,/^set /{/^#/s/^# \{0,1\}//p}' "${BASH_SOURCE[0]}"
}

preset=draft
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
    draft | standard | paper) ;;
    *) echo "quickstart: $preset is not a preset, must be draft, standard or paper" >&2; exit 1 ;;
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
say "Building (the first time takes about 15 minutes on two cores)"
cargo build --release -p guardsplat-worker --locked
worker=${CARGO_TARGET_DIR:-$repository/target}/release/guardsplat-worker

message=c0ffee42
# Of another run; a stale file must not pass for a result of this one.
rm -rf "$out/marked.ply" "$out/views-unmarked" "$out/views-marked" "$out/report"

say "A sample scene"
"$worker" sample "$out/scene.ply"
say "A key for messages of 32 bits"
"$worker" key create --bits 32 -o "$out/quickstart.key" --device "$device"

say "Embedding the message $message (preset $preset)"
status=0
"$worker" embed "$out/scene.ply" "$out/marked.ply" --key "$out/quickstart.key" --message "$message" \
    --preset "$preset" --device "$device" --report "$out/report" || status=$?
case $status in
    0) ;;
    3)
        echo "quickstart: the mark missed the target of the preset $preset, so no marked scene was written;" \
            "the pictures in $out/report show how far it got. --preset standard takes longer and marks better." >&2
        exit 3
        ;;
    *) echo "quickstart: embedding failed" >&2; exit 1 ;;
esac

say "Rendering both scenes"
"$worker" render "$out/scene.ply" "$out/views-unmarked" --views 5 --device "$device"
"$worker" render "$out/marked.ply" "$out/views-marked" --cameras "$out/views-unmarked/cameras.json" --device "$device"

# Prints the verdict on one reading, and remembers whether it is the one expected.
surprises=0
expect() {
    local title=$1 expected=$2 status=0
    shift 2
    say "$title"
    "$worker" verify "$@" --key "$out/quickstart.key" --message "$message" --device "$device" || status=$?
    if [ "$status" -eq 1 ]; then
        echo "quickstart: verification failed" >&2
        exit 1
    elif [ "$status" -ne "$expected" ]; then
        echo "quickstart: that is not the expected verdict (exit code $status instead of $expected)" >&2
        surprises=$((surprises + 1))
    fi
}
expect "The marked scene, expected to match" 0 "$out/marked.ply"
expect "Pictures of the marked scene, expected to match" 0 "$out/views-marked"
expect "The unmarked scene, expected not to match" 2 "$out/scene.ply"
expect "Pictures of the unmarked scene, expected not to match" 2 "$out/views-unmarked"

say "Done"
cat <<END
unmarked scene   $out/scene.ply
marked scene     $out/marked.ply
key              $out/quickstart.key
unmarked views   $out/views-unmarked
marked views     $out/views-marked
side by side     $out/report/comparison.png (unmarked, marked, ten times the difference)
END
if [ "$surprises" -gt 0 ]; then
    echo "quickstart: $surprises of 4 verdicts were not as expected" >&2
    exit 1
fi
echo "The marked scene is recognised, the unmarked one is not."
