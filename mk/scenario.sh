#!/usr/bin/env bash
# Plays one of the long scenarios at full size: scenario.sh NAME [OPTION...]. Figures go to .buildarena/.
set -euo pipefail
name=${1:-}
shift || true
python=.venv/bin/python
game=tests/simworker/besiege
export PYTHONPATH=$PWD:$PWD/tests

run() {
    local program=$1
    shift
    "$python" -m "scenarios.$program.run" --json ".buildarena/$program.json" "$@"
}

case $name in
attack | soak | containers) run "$name" "$@" ;;
hunt)
    # The search's library brings 80 MB along, which nobody needs who does not hunt.
    "$python" -c 'import ribs' 2>/dev/null || bash mk/install_tool.sh "$python" ribs
    OMP_NUM_THREADS=1 "$python" -m scenarios.hunt.run "$@"
    ;;
chaos)
    CHAOS_KILLS=20 CHAOS_JOBS=2000 CHAOS_EVERY_S=5 CHAOS_LEASE_S=10 CHAOS_COMMANDS_S=60 \
        .venv/bin/pytest scenarios/chaos -s --timeout 3600 "$@"
    ;;
besiege)
    BESIEGE_TASKS=all BESIEGE_KILLS=20 .venv/bin/pytest -n 2 --timeout=900 \
        "$game/test_end_to_end.py" "$game/test_killed_runner.py" "$game/test_real_game.py" "$@"
    BESIEGE_FILES=10000 .venv/bin/pytest --timeout=3600 tests/besiege/test_hostile_files.py
    ;;
*)
    echo "no scenario '$name'; there are: attack besiege chaos containers hunt soak" >&2
    exit 2
    ;;
esac
