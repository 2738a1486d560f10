#!/usr/bin/env bash
# Makes the base images by debootstrap: make.sh TAG. Needs root and a running Docker engine.
set -euo pipefail
tag=$1
docker=${DOCKER:-docker}
here=$(cd "$(dirname "$0")" && pwd)
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT

mirror=$(cat /etc/apt/sources.list /etc/apt/sources.list.d/* 2>/dev/null |
    sed -nE 's/^(URIs: *|deb +(\[[^]]*\] +)?)(https?:[^ ]+).*/\3/p' | sed -n 1p || true)
debootstrap --variant=minbase --include=python3,python3-venv,ca-certificates bookworm "$folder" "$mirror" >"$folder.log" 2>&1 ||
    { cat "$folder.log" >&2; exit 1; }
rm -f "$folder.log"
# What the host trusts: a network may end TLS at a proxy with a certificate of its own.
cp /etc/ssl/certs/ca-certificates.crt "$folder/etc/ssl/certs/ca-certificates.crt"
# As in Debian's small images, of the documents licences stay.
find "$folder"/usr/share/doc -type f ! -name copyright -delete
rm -rf "$folder"/var/cache/apt/* "$folder"/var/lib/apt/lists/* "$folder"/usr/share/man/* \
    "$folder"/usr/share/locale/*
tar -C "$folder" -c . | "$docker" import \
    -c 'ENV SSL_CERT_FILE=/etc/ssl/certs/ca-certificates.crt PIP_CERT=/etc/ssl/certs/ca-certificates.crt NODE_EXTRA_CA_CERTS=/etc/ssl/certs/ca-certificates.crt' \
    - "buildarena-base/python:$tag" >/dev/null
for target in postgres valkey caddy s3; do
    DOCKER_BUILDKIT=1 "$docker" build --quiet --build-arg "PYTHON_IMAGE=buildarena-base/python:$tag" \
        --target "$target" --tag "buildarena-base/$target:$tag" "$here" >/dev/null
done
