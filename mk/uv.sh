#!/usr/bin/env bash
# Runs uv with the given words: the one that is installed, or one of our own in .venv-uv.
set -euo pipefail
own=.venv-uv
python=${PYTHON:-python3}

if uv --version >/dev/null 2>&1; then
    exec uv "$@"
fi
if "$python" -m uv --version >/dev/null 2>&1; then
    exec "$python" -m uv "$@"
fi
if ! "$own/bin/uv" --version >/dev/null 2>&1; then
    # A folder of its own is open to pip even where the system's package manager owns the Python.
    log=$(mktemp)
    trap 'rm -f "$log"' EXIT
    "$python" -m pip install --quiet --disable-pip-version-check --target "$own" --upgrade uv >"$log" 2>&1 ||
        { "$python" -m venv "$own" && "$own/bin/python" -m pip install --quiet uv; } >>"$log" 2>&1 || {
        cat "$log" >&2
        echo "uv could not be installed with $python: install uv, or set PYTHON=/path/to/python3.11" >&2
        exit 1
    }
    rm -f "$log"
fi
exec "$own/bin/uv" "$@"
