#!/usr/bin/env bash
# `make soak`: what takes too long, or measures too much, for `make check`. Alone on the machine; needs root and ../shared.
# The cameras' part: 200 cycles of unplugging (spec/reliability.md 22), ten minutes of two cameras, what their
# frames cost, bombs by the clock.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
[ -d ../shared ] || { echo "soak: ../shared is absent, and without its camera lab there is nothing to soak" >&2; exit 1; }
tools/setup.sh
tools/camera-lab.sh
export DEMETER_SOAK=1
cargo build --locked --bin demeter --package demeter --package demeter-tests
cargo nextest run --locked --profile soak --package demeter-capture --package demeter-tests --no-capture \
    --run-ignored all
