#!/bin/bash
# Puts ONNX Runtime's shared library, its licence and notices into .cache/onnxruntime/ of the project.
# The library is the one inside PyPI's onnxruntime wheel: ort's own download needs a host that we do not reach.
# Does nothing when the library is there and whole.
set -euo pipefail

version=1.31.1
case "$(uname -m)" in
    x86_64) sha256=fc44112fbe06d7d689c57e11d3862031f64711007e4ee020f8eed5185fd2c1d3 ;;
    aarch64) sha256=8aa3b76b28c778a2b1dd660d34161adb1d508c9ccd04ff9dc80e26eca5df8467 ;;
    *) echo "fetch-onnxruntime: no library is pinned for $(uname -m); expected x86_64 or aarch64" >&2; exit 1 ;;
esac
cache="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)/.cache/onnxruntime"
library="libonnxruntime.so.$version"

whole() { echo "$sha256  $1" | sha256sum --check --status 2>/dev/null; }

if whole "$cache/$library" && [ -s "$cache/LICENSE" ] && [ -s "$cache/ThirdPartyNotices.txt" ]; then
    exit 0
fi
mkdir -p "$cache"
work="$(mktemp -d "$cache/.fetch.XXXXXX")"
trap 'rm -rf "$work"' EXIT
# Wheels differ by Python tag, so the tag is fixed: every machine pins the same bytes, whatever Python it has.
python3 -m pip download --quiet --disable-pip-version-check --no-deps --only-binary :all: --dest "$work" \
    --python-version 3.11 --implementation cp --abi cp311 --platform "manylinux_2_28_$(uname -m)" "onnxruntime==$version"
(cd "$work" && python3 -m zipfile -e onnxruntime-*.whl wheel)
if ! whole "$work/wheel/onnxruntime/capi/$library"; then
    echo "fetch-onnxruntime: $library: expected sha256 $sha256, found:" >&2
    sha256sum "$work/wheel/onnxruntime/capi/$library" >&2
    exit 1
fi
mv "$work/wheel/onnxruntime/LICENSE" "$work/wheel/onnxruntime/ThirdPartyNotices.txt" "$cache/"
# The library comes last and by rename, so a stopped run leaves nothing that looks complete.
mv "$work/wheel/onnxruntime/capi/$library" "$cache/"
echo "fetch-onnxruntime: $cache/$library" >&2
