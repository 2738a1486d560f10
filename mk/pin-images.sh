#!/usr/bin/env bash
# Writes the digest of each image that others publish behind its tag, wherever it is named, so that
# what runs is what was looked at. Again, it writes the digests that the tags have then. It asks the
# images' registries, by the Docker client; FILES are those that name images.
set -euo pipefail
docker=${DOCKER:-docker}
images=$(grep -hoE '((POSTGRES|VALKEY|S3|PROMETHEUS|ALERTMANAGER|GRAFANA|COLLECTOR|PYTHON|CADDY)_IMAGE(:-|=)|^ +image: )[a-z0-9./-]+:[A-Za-z0-9._-]+' "$@" |
    sed -E 's/^.*(:-|=| )//' | grep -v '^buildarena/' | sort -u)
for image in $images; do
    digest=$("$docker" buildx imagetools inspect "$image" --format '{{.Manifest.Digest}}')
    if ! [[ $digest =~ ^sha256:[0-9a-f]{64}$ ]]; then
        echo "$image has no digest: '$digest'" >&2
        exit 1
    fi
    plain=${image//./\\.}
    for file in "$@"; do
        sed -E -i.before "s#([-= \"]|^)$plain(@sha256:[0-9a-f]{64})?([^A-Za-z0-9._-]|\$)#\\1$image@$digest\\3#g" "$file"
        rm -f "$file.before"
    done
    echo "$image@$digest"
done
