#!/usr/bin/env bash
# Environments of the adapters: integrations.sh install NAME LIBRARY..., check NAME..., test MARKS NAME...,
# lock NAME LIBRARY...
set -euo pipefail
here=$(dirname "$0")
environments=.venv-integrations

uv() {
    bash "$here/uv.sh" "$@"
}

install() {
    local name=$1 editable=() package
    local environment=$environments/$name
    shift
    uv venv --quiet --clear --no-project --python .venv/bin/python "$environment"
    uv pip sync --quiet --python "$environment/bin/python" "integrations/$name/requirements.lock"
    for package in "$@" "integrations/$name"; do
        editable+=(-e "$package")
    done
    uv pip install --quiet --python "$environment/bin/python" --no-deps --no-build-isolation "${editable[@]}"
}

check() {
    local name
    for name in "$@"; do
        .venv/bin/ruff format --check --quiet "integrations/$name"
        .venv/bin/ruff check --quiet "integrations/$name"
        MYPYPATH=integrations/$name/src .venv/bin/mypy --no-error-summary --python-executable "$environments/$name/bin/python" "integrations/$name/src"
    done
}

run_tests() {
    local marks=$1 name failed=0
    shift
    for name in "$@"; do
        echo "-- $name"
        "$environments/$name/bin/pytest" --confcutdir "integrations/$name" "integrations/$name/tests" -n "${WORKERS:-2}" --dist loadfile -rs \
            -m "$marks" || failed=1
    done
    return "$failed"
}

lock() {
    local name=$1
    shift
    physics=$(mktemp)
    trap 'rm -f "$physics"' EXIT
    grep -E '^(numpy|scipy|mujoco|pybullet|python-fcl|threadpoolctl)==' requirements.lock | sed 's/ *\\$//' >"$physics"
    # shellcheck disable=SC2046 # libraries are words
    uv pip compile --quiet --universal --generate-hashes --no-annotate -c "$physics" \
        --custom-compile-command "make lock" \
        $(printf -- '--no-emit-package buildarena-%s ' $(basename -a "$@") client "$name") \
        -o "integrations/$name/requirements.lock" \
        integrations/tests.in "integrations/$name/pyproject.toml" \
        $(printf '%s/pyproject.toml ' "$@")
}

command=$1
shift
case $command in
install | check | lock) "$command" "$@" ;;
test) run_tests "$@" ;;
esac
