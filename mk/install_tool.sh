#!/usr/bin/env bash
# Installs tools that not everyone needs, as the lock has them: install_tool.sh PYTHON DISTRIBUTION...
set -euo pipefail
python=$1
shift
lock=$(mktemp)
trap 'rm -f "$lock"' EXIT
"$python" "$(dirname "$0")/locked.py" requirements.lock "$@" >"$lock"
bash "$(dirname "$0")/uv.sh" pip install --quiet --python "$python" --require-hashes -r "$lock"
