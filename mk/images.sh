#!/usr/bin/env bash
# Builds every image from what is committed, each as an OCI archive with a bill of materials and a
# statement of provenance: images.sh FOLDER. Needs Docker's buildx with a builder that attests.
set -euo pipefail
out=$1
docker=${DOCKER:-docker}
"$docker" buildx version >/dev/null || { echo "images need Docker with its plugin buildx" >&2; exit 1; }
version=$(sed -n 's/^version = "\(.*\)"/\1/p' clients/cli/pyproject.toml)
changed=$(git status --porcelain)
if [ -n "$changed" ]; then
    printf 'images are built from what is committed; there are changes:\n%s\n' "$changed" >&2
    exit 1
fi
mkdir -p "$out"
for target in api construct simulate-pybullet simulate-mujoco tools proxy; do
    "$docker" buildx build --file deploy/docker/Dockerfile --target "$target" \
        --sbom=true --provenance=mode=max --tag "buildarena/$target:$version" \
        --output "type=oci,dest=$out/$target.tar" .
done
