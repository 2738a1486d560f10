#!/usr/bin/env bash
# Gives every distribution one new version: version.sh VERSION PACKAGE...
set -euo pipefail
version=${1:-}
shift || true
if ! [[ $version =~ ^[0-9]+\.[0-9]+\.[0-9]+((a|b|rc)[0-9]+)?$ ]]; then
    echo "'$version' is no version: make release V=0.2.0, or V=0.2.0rc1" >&2
    exit 2
fi
for package in "$@"; do
    sed -E -i.before \
        -e "s/^version = \".*\"/version = \"$version\"/" \
        -e "s/\"(buildarena-[a-z-]+(\[[a-z]+\])?)==[^\"]+\"/\"\1==$version\"/" "$package/pyproject.toml"
    rm -f "$package"/pyproject.toml.before
done
# Images have the version of what is in them.
for file in docker-compose.yml .env.example deploy/kubernetes/*/*/kustomization.yaml deploy/kubernetes/*/*/jobs/kustomization.yaml; do
    [ -f "$file" ] || continue
    sed -E -i.before \
        -e "s/(BUILDARENA_VERSION:-)[^}]+/\1$version/" \
        -e "s/^(# BUILDARENA_VERSION=)[^ ]+/\1$version/" \
        -e "s/^(nameSuffix: -).*/\1$version/" \
        -e "s/^(  - \{name: buildarena\/[a-z-]+, newTag: )[^}]+/\1$version/" "$file"
    rm -f "$file.before"
done
echo "every distribution is now $version; say in CHANGELOG.md what changed"
