#!/usr/bin/env bash
# Fills /opt/buildarena of an image: "requirements NAME" from a lock, then "parts NAME" from wheels, with
# the programs of the stage that is mounted as /mnt. What lower layers have is not installed again.
set -euo pipefail
what=$1
name=$2
recipe=/mnt/recipe
environment=/opt/buildarena
python=$environment/bin/python
export UV_LINK_MODE=copy UV_PYTHON_DOWNLOADS=never UV_NATIVE_TLS=1 UV_COMPILE_BYTECODE=0
unset PYTHONDONTWRITEBYTECODE
uv() { /mnt/source/.venv/bin/uv --quiet "$@"; }

case $what in
requirements)
    began=$(date +%s)
    [ -x "$python" ] || uv venv --no-project --python "$(python3 -c 'import sys; print(sys._base_executable)')" "$environment"
    uv pip install --python "$python" --require-hashes --no-deps -r "$recipe/locks/$name.lock"
    "$python" "$recipe/shrink.py" "$began"
    "$python" "$recipe/licences.py" "$environment/licenses"
    ;;
parts)
    # The distribution of this name and, of the others, those that it asks for.
    mapfile -t parts < <("$python" "$recipe/siblings.py" "buildarena-$name")
    [ "${#parts[@]}" -gt 0 ]
    # Not from uv's cache, which takes a wheel of the same version for the same, whatever is in it.
    uv pip install --no-cache --python "$python" --no-index --find-links /mnt/wheels --no-deps "${parts[@]}"
    # Which also compiles what is loaded, and no more: half of the libraries' sources never are.
    "$python" "$recipe/imports.py"
    ;;
esac
