#!/usr/bin/env bash
# Makes the environment: install.sh FOLDER PACKAGE... PYTHON may name the Python to use.
set -euo pipefail
venv=$1
shift
packages=("$@")
here=$(dirname "$0")

uv() {
    bash "$here/uv.sh" "$@"
}

# The newest Python is not the best one: PyBullet has no wheel for it and must be compiled.
choose_python() {
    local version
    if [ -n "${PYTHON:-}" ]; then
        command -v "$PYTHON" || echo "$PYTHON"
        return
    fi
    if "$venv/bin/python" -c '' 2>/dev/null; then
        echo "$venv/bin/python"
        return
    fi
    for version in 3.11 3.12 3.13; do
        uv python find --system --no-python-downloads "cpython$version" 2>/dev/null && return
    done
    uv python install --quiet 3.11 2>/dev/null || true
    uv python find --system --no-python-downloads cpython3.11 2>/dev/null || command -v python3 || echo python3
}

# What the packages and the tests need of the lock, less what is named.
locked() {
    "$python" "$here/locked.py" requirements.lock "${packages[@]}" requirements-dev.in --without "$@"
}

sync() {
    uv pip sync --quiet --python "$venv/bin/python" "$@"
}

install_requirements() {
    locked >"$venv/requirements.lock"
    sync --only-binary pybullet --only-binary pybullet-arm64 "$venv/requirements.lock" 2>/dev/null && return
    locked pybullet pybullet-arm64 >"$venv/without-pybullet.lock"
    sync "$venv/without-pybullet.lock"
    if ! command -v "${CXX:-c++}" >/dev/null; then
        echo "PyBullet has no wheel for $system and there is no C++ compiler: without it, name MuJoCo where machines are simulated (simulator: mujoco)."
        return
    fi
    echo "PyBullet has no wheel for $system: compiling it, which takes some minutes. README.md names the systems that need not."
    sync "$venv/requirements.lock" 2>"$venv/pybullet.log" ||
        echo "PyBullet could not be compiled (see $venv/pybullet.log): without it, name MuJoCo where machines are simulated (simulator: mujoco)."
}

python=$(choose_python)
"$python" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null || {
    echo "BuildArena needs Python 3.11 or newer, and $python is older or missing: set PYTHON=/path/to/python3.11" >&2
    exit 1
}
system=$("$python" -c 'import platform as p; print(f"Python {p.python_version()} on {p.system()} {p.machine()}")')
if [ "$python" != "$venv/bin/python" ]; then
    uv venv --quiet --clear --no-project --python "$python" "$venv"
fi
install_requirements
editable=()
for package in "${packages[@]}"; do
    editable+=(-e "$package")
done
uv pip install --quiet --python "$venv/bin/python" --no-deps --no-build-isolation "${editable[@]}"
