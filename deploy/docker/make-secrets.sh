#!/usr/bin/env bash
# Makes the secrets that docker-compose.yml mounts, in ./secrets or the folder that is named. What is
# there already stays. The folder opens for its owner alone; its files open for all, because the
# containers' accounts are not yours.
set -euo pipefail
folder=${1:-secrets}
umask 077
mkdir -p "$folder"

keep() {
    local file=$folder/$1
    if [ -s "$file" ]; then cat >/dev/null; else cat >"$file"; fi
    chmod 644 "$file"
}
random() {
    head -c 32 /dev/urandom | od -An -tx1 | tr -d ' \n'
}

random | keep postgres_password
random | keep valkey_password
random | keep admin_key
random | keep metrics_key
random | keep grafana_password
random | head -c 20 | keep s3_access_key
random | keep s3_secret_key
printf 'postgresql://buildarena:%s@postgres:5432/buildarena' "$(cat "$folder/postgres_password")" | keep database_url
# The superuser's URL above is for the service `roles` alone, which makes these logins.
login() {
    printf 'postgresql://buildarena_%s_login:%s@postgres:5432/buildarena' "$1" "$(random)"
}
login owner | keep database_url_owner
login api | keep database_url_api
login construct | keep database_url_construct
login simulate | keep database_url_simulate
login reader | keep database_url_reader
printf 'redis://:%s@valkey:6379/0' "$(cat "$folder/valkey_password")" | keep broker_url
printf '{"identities": [{"name": "buildarena", "credentials": [{"accessKey": "%s", "secretKey": "%s"}], "actions": ["Admin", "Read", "Write", "List"]}]}' \
    "$(cat "$folder/s3_access_key")" "$(cat "$folder/s3_secret_key")" | keep s3_config
cat "$(dirname "$0")/../monitoring/alertmanager/receivers.yml" | keep receivers
echo "secrets are in $folder; the operator's key is $folder/admin_key; alerts go to whom $folder/receivers names"
