#!/usr/bin/env bash
# Wheels and sdists of airflock and airflock-papers of this commit with their hashes: the same commit gives the same bytes.
# Usage: tools/build.sh FOLDER   (needs the package build)
set -euo pipefail
out=$(realpath -m "${1:?give a folder}")
cd "$(dirname "$0")/.."
SOURCE_DATE_EPOCH=$(git log -1 --format=%ct)
export SOURCE_DATE_EPOCH
umask 022
rm -rf "$out"
python -m build --outdir "$out" .
python -m build --outdir "$out" papers
cd "$out"
sha256sum ./*.whl ./*.tar.gz > SHA256SUMS
