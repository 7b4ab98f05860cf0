#!/usr/bin/env bash
# Makes server/page/vendor from the packages in package-lock.json, which has the SHA-512 of each, and from the protos.
# What it makes is in the repository, so nobody needs this but who changes a version or the API.
#
#     tools/page/vendor.sh           makes it anew
#     tools/page/vendor.sh --check   says whether it is what this makes; 3 where packages can't be fetched
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")"
kept=../../server/page/vendor
made=$kept
if [ "${1:-}" = --check ]; then
    made=$(mktemp -d)
fi

# No package runs anything of its own.
npm ci --ignore-scripts --no-audit --no-fund --loglevel=error || exit 3
tools=$PWD/node_modules/.bin
mkdir -p node_modules/.generated
ln -sfn node_modules/.generated generated
trap 'rm -f generated; [ "$made" = "$kept" ] || rm -rf "$made"' EXIT
export PATH="$tools:$PATH"
generate() {
    buf generate "$1" --template '{"version":"v2","plugins":[{"local":"protoc-gen-es","out":"node_modules/.generated","opt":"target=js"}]}' "${@:2}"
}
paths=()
for file in artifact_service job job_service key_service registry_service; do
    paths+=(--path "../../proto/guardsplat/v1/$file.proto")
done
generate ../../proto "${paths[@]}"
generate proto
bundle() {
    esbuild "$1.js" --bundle --format=esm --minify --target=es2022 --charset=utf8 --legal-comments=none \
        --log-level=warning --outfile="$made/$1.js"
}
bundle api
bundle splats
for package in @bufbuild/protobuf @connectrpc/connect @connectrpc/connect-web @noble/hashes @sparkjsdev/spark fflate three zstddec; do
    version=$(node -p "require('./node_modules/$package/package.json').version")
    license=$(node -p "require('./node_modules/$package/package.json').license")
    echo "== $package $version ($license)"
    file=$(find "node_modules/$package" -maxdepth 1 -iname 'licen[cs]e*' | sort | head -n 1)
    if [ -n "$file" ]; then cat "$file"; else echo "The Apache License, below."; fi
    echo
done >"$made/LICENSES.txt"
{
    echo "== The part of @bufbuild/protobuf that is under the 3-clause BSD licence"
    sed -n '/^\/\/ Copyright 2008 Google/,/^\/\/ .*SUCH DAMAGE\|^[^\/]/p' node_modules/@bufbuild/protobuf/dist/esm/wire/varint.js | sed -n 's/^\/\/ \?//p'
    echo
    echo "== Apache License"
    cat ../../LICENSE-APACHE
} >>"$made/LICENSES.txt"
if [ "$made" != "$kept" ]; then
    diff -rq "$made" "$kept" || {
        echo "vendor: server/page/vendor is not what tools/page/vendor.sh makes" >&2
        exit 1
    }
    echo "vendor: server/page/vendor is what the packages and protos make"
fi
