#!/usr/bin/env bash
# `make sync-check`: the bundled session is replayed, synced to a real S3 server (Garage, built once in about 12 minutes
# on two cores) and to a folder, and read back there by DuckDB and pyarrow with the query of docs/sync.md.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
export PATH="$PWD/.cache/tools/bin:$PATH"
demeter=target/debug/demeter
venv=.cache/sync-check

command -v garage >/dev/null || cargo install --locked --root .cache/tools garage@^2.5
if [ ! -x "$venv/bin/python" ]; then
    python3 -m venv "$venv"
    "$venv/bin/pip" install -q 'duckdb==1.*' 'pyarrow==26.*' 's3fs==2026.*'
fi

work=$(mktemp -d)
server=
trap '[ -z "$server" ] || kill "$server"; rm -rf "$work"' EXIT
umask 077
port() { "$venv/bin/python" -c 'import socket; s = socket.socket(); s.bind(("127.0.0.1", 0)); print(s.getsockname()[1])'; }
s3=$(port)

# One node that keeps everything in the work folder.
export GARAGE_DEFAULT_ACCESS_KEY GARAGE_DEFAULT_SECRET_KEY GARAGE_DEFAULT_BUCKET=demeter
GARAGE_DEFAULT_ACCESS_KEY=GK$(od -An -N12 -tx1 /dev/urandom | tr -d ' \n')
GARAGE_DEFAULT_SECRET_KEY=$(od -An -N32 -tx1 /dev/urandom | tr -d ' \n')
cat > "$work/garage.toml" <<EOF
metadata_dir = "$work/meta"
data_dir = "$work/data"
db_engine = "sqlite"
replication_factor = 1
rpc_bind_addr = "127.0.0.1:$(port)"
rpc_public_addr = "127.0.0.1:3901"
rpc_secret = "$(od -An -N32 -tx1 /dev/urandom | tr -d ' \n')"

[s3_api]
s3_region = "garage"
api_bind_addr = "127.0.0.1:$s3"
EOF
RUST_LOG=garage=warn garage -c "$work/garage.toml" server --single-node --default-bucket > "$work/garage.log" 2>&1 &
server=$!
for _ in $(seq 100); do
    curl -s -o "$work/answer" "http://127.0.0.1:$s3/" && break
    kill -0 "$server" || { cat "$work/garage.log" >&2; exit 1; }
    sleep 0.2
done

# The fixture has no receiver: every second plant gets a place, so that both kinds of geometry are read back.
$demeter replay tests/fixtures/row --db "$work/demeter.sqlite" > "$work/plants.txt"
"$venv/bin/python" - "$work/demeter.sqlite" <<'EOF'
import sqlite3, sys
store = sqlite3.connect(sys.argv[1])
store.execute("UPDATE plants SET latitude = 52.0 + seq * 1e-5, longitude = 5.5 WHERE seq % 2 = 0")
store.commit()
EOF
cp "$work/demeter.sqlite" "$work/second.sqlite"
echo "$GARAGE_DEFAULT_SECRET_KEY" > "$work/secret"
mkdir "$work/disk"
cat > "$work/garage-sync.toml" <<EOF
[store]
path = "$work/demeter.sqlite"
[api]
listen = "127.0.0.1:$(port)"
[sync]
url = "s3://demeter/farm"
endpoint = "http://127.0.0.1:$s3"
region = "garage"
user = "$GARAGE_DEFAULT_ACCESS_KEY"
secret_file = "$work/secret"
trust_clock = true
EOF
cat > "$work/disk-sync.toml" <<EOF
[store]
path = "$work/second.sqlite"
[api]
listen = "127.0.0.1:$(port)"
[sync]
url = "file://$work/disk"
trust_clock = true
EOF
for place in garage disk; do
    echo "== $place"
    time $demeter sync --now --config "$work/$place-sync.toml"
    $demeter sync --now --json --config "$work/$place-sync.toml" | grep '"objects":0'
done
"$venv/bin/python" tools/sync_check.py "$demeter" "$work/demeter.sqlite" "$work/disk" "http://127.0.0.1:$s3" demeter/farm
