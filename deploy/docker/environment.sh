#!/usr/bin/env bash
# Makes /opt/buildarena of an image: "requirements NAME" from a lock, then "parts NAME" from wheels.
set -euo pipefail
what=$1
name=$2
environment=/opt/buildarena

shrink() {
    # Models and recordings of PyBullet's examples, and tests that libraries carry along.
    rm -rf "$environment"/lib/python3*/site-packages/pybullet_data
    find "$environment" -type d \( -name tests -o -name test \) -path '*/site-packages/*' \
        -not -path '*/hypothesis/*' -prune -exec rm -rf {} +
    find "$environment" -name '*.so*' -type f -size +200k -exec strip --strip-unneeded {} + 2>/dev/null || true
}

case $what in
requirements)
    base=$(python3 -c 'import sys; print(sys._base_executable)')
    uv venv --quiet --no-project --python "$base" "$environment"
    uv pip install --quiet --python "$environment/bin/python" --require-hashes --no-deps --compile-bytecode \
        -r "deploy/docker/locks/$name.lock"
    shrink
    ;;
parts)
    # The distribution of this name and, of the others, those that it asks for.
    mapfile -t parts < <(python3 deploy/docker/siblings.py "buildarena-$name")
    [ "${#parts[@]}" -gt 0 ]
    uv pip install --quiet --python "$environment/bin/python" --no-index --find-links /wheels --no-deps \
        --compile-bytecode "${parts[@]}"
    ;;
esac
