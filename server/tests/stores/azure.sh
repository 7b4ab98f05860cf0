#!/usr/bin/env bash
# Tries the artifact store on Azurite, Microsoft's emulator of Azure Blob Storage (from npm), which it installs into a folder
# of its own and stops at the end. Needs Node.js with npm, Python with venv, and openssl. Not part of the checks: nothing
# else here needs Node.js. No emulator of Google's in a package registry knows the requests that lists and parts are.
set -euo pipefail
cd "$(dirname "$0")/../../.."
folder=$(mktemp -d)
azurite=
trap 'kill $azurite 2>/dev/null || true; rm -rf "$folder"' EXIT

npm install --prefix "$folder" --no-audit --no-fund --silent azurite
python3 -m venv "$folder/python"
"$folder/python/bin/pip" install --quiet azure-storage-blob

# An account of this run's own.
export AZURE_STORAGE_ACCOUNT_NAME=tester AZURE_ALLOW_HTTP=true
AZURE_STORAGE_ACCOUNT_KEY=$(openssl rand -base64 48)
export AZURE_STORAGE_ACCOUNT_KEY AZURITE_ACCOUNTS="tester:$AZURE_STORAGE_ACCOUNT_KEY"
port=${AZURITE_PORT:-10100}
export AZURE_STORAGE_ENDPOINT=http://127.0.0.1:$port/tester
"$folder/node_modules/.bin/azurite-blob" --silent --disableTelemetry --skipApiVersionCheck --location "$folder/blobs" --blobPort "$port" &
azurite=$!
for _ in $(seq 200); do
    (exec 3<>"/dev/tcp/127.0.0.1/$port") 2>/dev/null && break
    sleep 0.1
done
"$folder/python/bin/python" - <<'PYTHON'
import os
from azure.storage.blob import BlobServiceClient

account = {key: os.environ[f"AZURE_STORAGE_{key.upper()}"] for key in ("account_name", "account_key")}
BlobServiceClient(os.environ["AZURE_STORAGE_ENDPOINT"], credential=account).create_container("guardsplat")
PYTHON

GUARDSPLAT_TEST_ARTIFACTS=az://guardsplat/tried cargo test --release --workspace --locked --lib artifacts::tests::service \
    -- --ignored --nocapture --test-threads 1
