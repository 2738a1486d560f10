#!/usr/bin/env bash
# Whether the dashboard differs from the branch that a change is to be merged into.
set -euo pipefail
base=HEAD
for branch in origin/HEAD origin/main; do
    if git rev-parse --verify --quiet "$branch" >/dev/null; then
        base=$(git merge-base HEAD "$branch")
        break
    fi
done
! git diff --quiet "$base" -- clients/web ||
    [ -n "$(git ls-files --others --exclude-standard -- clients/web)" ]
