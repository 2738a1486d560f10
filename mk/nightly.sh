#!/usr/bin/env bash
# All that is too long for every change: nightly.sh ADAPTER... Each part runs, whatever others gave;
# in the end it says how long each took, and what failed.
set -uo pipefail
here=$(dirname "$0")
failed=()
lines=()

part() {
    local name=$1 began=$SECONDS outcome=passed
    shift
    echo "== $name"
    "$@" || { outcome=FAILED && failed+=("$name"); }
    lines+=("$(printf '%-34s %-7s %4d:%02d' "$name" "$outcome" $(((SECONDS - began) / 60)) $(((SECONDS - began) % 60)))")
}

tests() {
    MALLOC_ARENA_MAX=2 MALLOC_TRIM_THRESHOLD_=131072 .venv/bin/pytest -n "${WORKERS:-$(getconf _NPROCESSORS_ONLN)}" \
        --dist loadfile --no-loadscope-reorder -rs -m nightly
}

# Without the search's library the tests of the hunt are left out.
part "hunt's library" bash "$here/install_tool.sh" .venv/bin/python ribs
part "tests" tests
part "adapters" bash "$here/integrations.sh" test "" "$@"
part "attack" bash "$here/scenario.sh" attack
part "hunt" bash "$here/scenario.sh" hunt --minutes "${HUNT_MINUTES:-10}"
part "soak" bash "$here/scenario.sh" soak --seconds "${SOAK_S:-600}" --jobs "${SOAK_JOBS:-3000}"
if command -v docker >/dev/null; then
    part "containers" bash "$here/scenario.sh" containers
else
    lines+=("containers: left out, there is no Docker (Debian's packages docker.io, docker-compose and debootstrap)")
fi
echo "== nightly, $((SECONDS / 60)) minutes"
printf '%s\n' "${lines[@]}"
[ "${#failed[@]}" -eq 0 ]
