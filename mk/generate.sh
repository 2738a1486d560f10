#!/usr/bin/env bash
# Writes again what is committed and made by a program: generate.sh [NAME...]; without one: sessions, games, inspect and sweeps.
set -euo pipefail
python=.venv/bin/python
export PYTHONPATH=$PWD:$PWD/tests

[ $# -gt 0 ] || set -- sessions games inspect sweeps
for name in "$@"; do
    case $name in
    sessions) "$python" -m support.documents.kept_sessions ;;
    schema) "$python" -m support.documents.kept_schema ;;
    games) "$python" -c 'from support import blas_kernels; from support.game.record_games import main; main()' ;;
    inspect) "$python" mk/inspect_tasks.py ;;
    sweeps) "$python" -c 'import json; from buildarena_cli.sweep_files import sweep_schema; print(json.dumps(sweep_schema(), indent=2, ensure_ascii=False))' >docs/sweep.schema.json ;;
    performance) "$python" -m benchmarks.page ;;
    pictures) "$python" tests/web/screenshots.py ;;
    digests) bash mk/pin-images.sh docker-compose.yml .env.example deploy/docker/Dockerfile deploy/kubernetes/overlays/*/*.yaml ;;
    *)
        echo "nothing is made that is called '$name'; there are: sessions games inspect sweeps schema performance pictures digests" >&2
        exit 2
        ;;
    esac
done
