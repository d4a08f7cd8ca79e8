#!/usr/bin/env bash
# `make faults`: the tests that assert times and memory, and the long counts of those that `make check` runs in short
# (reliability.md). Release build, one at a time, nothing else on the machine; the thousand kills take half an hour.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
export PATH="$PWD/.cache/tools/bin:$PATH"

tools/setup.sh
tools/cargo-tools.sh
DEMETER_FAULTS=full cargo nextest run --locked --release --package demeter --test sync --profile faults
cargo nextest run --locked --release --package demeter --run-ignored only --profile faults --no-capture "$@"
