#!/usr/bin/env bash
# Builds the two cargo tools `make check` needs into .cache/tools, each only when neither PATH nor the cache has it.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
export PATH="$PWD/.cache/tools/bin:$PATH"

command -v cargo-nextest >/dev/null || cargo install --locked --root .cache/tools cargo-nextest@0.9.143
# Without its default features cargo-deny brings no TLS of its own; the checks made here need no network.
command -v cargo-deny >/dev/null || cargo install --locked --no-default-features --root .cache/tools cargo-deny@0.20.2
