#!/usr/bin/env bash
# `make sync-check`: the bundled session is replayed, synced to a real S3 server (Garage, built once in about 12 minutes
# on two cores) and to a folder, read back there by DuckDB and pyarrow with the queries of docs/sync.md, compacted, and read
# back again.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
export PATH="$PWD/.cache/tools/bin:$PATH"
demeter=target/debug/demeter
venv=.cache/sync-check

# Garage is built in a folder that stays until it is done, so that a build that was cut goes on where it was.
if ! command -v garage >/dev/null; then
    cargo install --locked --root .cache/tools --target-dir .cache/tools/garage-build garage@^2.5
    rm -rf .cache/tools/garage-build
fi
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
# The same drive with another rig comes late, for a month that is compacted by then.
cp "$work/demeter.sqlite" "$work/late.sqlite"
"$venv/bin/python" - "$work/late.sqlite" <<'EOF'
import sqlite3, sys
store = sqlite3.connect(sys.argv[1])
store.execute("INSERT INTO rigs VALUES ('late')")
store.execute("UPDATE sessions SET rig = 'late'")
store.commit()
EOF
echo "$GARAGE_DEFAULT_SECRET_KEY" > "$work/secret"
mkdir "$work/disk"
# Each place gets both stores, out of copies of its own: what was sent leaves the outbox.
for place in garage disk; do
    for store in demeter late; do
        cp "$work/$store.sqlite" "$work/$place-$store.sqlite"
        {
            echo "[store]"
            echo "path = '$work/$place-$store.sqlite'"
            echo "[api]"
            echo "listen = '127.0.0.1:$(port)'"
            echo "[sync]"
            echo "trust_clock = true"
            if [ $place = disk ]; then
                echo "url = 'file://$work/disk'"
            else
                echo "url = 's3://demeter/farm'"
                echo "endpoint = 'http://127.0.0.1:$s3'"
                echo "region = 'garage'"
                echo "user = '$GARAGE_DEFAULT_ACCESS_KEY'"
                echo "secret_file = '$work/secret'"
            fi
        } > "$work/$place-$store.toml"
    done
done

there=("$work/disk" "http://127.0.0.1:$s3" demeter/farm)
both() {
    for place in garage disk; do
        echo "== $place: $*"
        "$1" "$work/$place" "$2"
    done
}
sync() {
    time $demeter sync --now --config "$1-$2.toml"
    $demeter sync --now --json --config "$1-$2.toml" | grep '"objects":0'
}
compact() {
    $demeter compact --json --config "$1-demeter.toml" | grep "\"written\":$2"
}
read_back() {
    "$venv/bin/python" tools/compact_check.py "${there[@]}" "$@"
}

both sync demeter
"$venv/bin/python" tools/sync_check.py "$demeter" "$work/demeter.sqlite" "${there[@]}"
both compact true
read_back 1+0 "$work/demeter.sqlite"
both sync late
read_back 1+1 "$work/demeter.sqlite" "$work/late.sqlite"
both compact true
both compact false
read_back 1+0 "$work/demeter.sqlite" "$work/late.sqlite"
