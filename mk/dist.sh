#!/usr/bin/env bash
# Builds what users install: dist.sh FOLDER. Wheels are made from the sdists, so both are whole.
set -euo pipefail
out=$1
here=$(dirname "$0")

mkdir -p "$out"
rm -f "$out"/buildarena*.whl "$out"/buildarena*.tar.gz
bash "$here/uv.sh" build --quiet --all-packages --no-build-isolation --python .venv/bin/python \
    --out-dir "$out" --no-create-gitignore
# pip takes hashes for all or for none, and our own wheels have none.
sed -E '/^ *(--hash|#|$)/d; s/ *\\$//' requirements.lock >"$out/constraints.txt"
echo "$out: $(ls "$out"/*.whl | wc -l) wheels, $(ls "$out"/*.tar.gz | wc -l) sdists, constraints.txt"
