#!/usr/bin/env bash
# Builds what users install: dist.sh FOLDER. Wheels are made from the sdists, so both are whole.
set -euo pipefail
out=$1
here=$(dirname "$0")

mkdir -p "$out"
rm -f "$out"/buildarena*.whl "$out"/buildarena*.tar.gz

build() {
    bash "$here/uv.sh" build --quiet --no-build-isolation --python .venv/bin/python \
        --out-dir "$out" --no-create-gitignore "$@"
}

# pip takes hashes for all or for none, and our own wheels have none.
constraints() {
    sed -E '/^ *(--hash|#|$)/d; s/ *\\$//' "$1"
}

build --all-packages
constraints requirements.lock >"$out/constraints.txt"
for adapter in integrations/*/; do
    build "$adapter"
    constraints "$adapter/requirements.lock" >"$out/constraints-$(basename "$adapter").txt"
done
# Hatch adds the repository's .gitignore and markers of the build to sdists, without an option.
for sdist in "$out"/buildarena*.tar.gz; do
    gunzip --stdout "$sdist" | tar --delete --wildcards '*/.*' | gzip --no-name >"$sdist.plain"
    mv "$sdist.plain" "$sdist"
done
echo "$out: $(ls "$out"/*.whl | wc -l) wheels, $(ls "$out"/*.tar.gz | wc -l) sdists, $(ls "$out"/constraints*.txt | wc -l) constraints"
