#!/usr/bin/env bash
# Format, lints, dependency rules and every test. The wall seconds of each step are printed before the tests run, so
# that nextest's summary closes the output.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
export PATH="$PWD/.cache/tools/bin:$PATH"

times=""
step() {
    local name=$1 start=$SECONDS
    shift
    echo "== $name" >&2
    "$@"
    times+=$(printf '%5d s  %s' $((SECONDS - start)) "$name")$'\n'
}

step "setup" tools/setup.sh
step "packages of the tests" tools/check-packages.sh
step "cargo tools" tools/cargo-tools.sh
step "camera lab" tools/camera-lab.sh
step "format" cargo fmt --all --check
step "dependency rules" cargo deny --log-level error check bans licenses sources
step "clippy" cargo clippy --locked --workspace --all-targets -- -D warnings
step "build the tests" cargo nextest run --locked --workspace --no-run
step "documentation tests" cargo test --locked --workspace --doc --quiet
if [ ! -d ../shared ]; then
    echo "../shared is absent; tests that need it say so and pass, in:" >&2
    grep -rlE --include='*.rs' '\.\./shared|shared\("' capture models recon firmware-host tests >&2 || true
fi
printf '%s' "$times" >&2
cargo nextest run --locked --workspace
