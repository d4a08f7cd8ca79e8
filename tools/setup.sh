#!/usr/bin/env bash
# Installs what the build needs and this machine lacks. Run again, it finds everything and downloads nothing.
# With the argument `training` it also installs what the Python side of models/training needs.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

packages=()
# SQLite is compiled from source and every binary is linked with the C compiler.
command -v cc >/dev/null || packages+=(build-essential)
# ONNX Runtime's library comes out of a Python wheel.
python3 -m pip --version >/dev/null 2>&1 || packages+=(python3-pip)
[ -e /etc/ssl/certs/ca-certificates.crt ] || packages+=(ca-certificates)
# The crate v4l reads the kernel's camera interface from its headers.
compgen -G '/usr/lib/llvm-*/lib/libclang.so' >/dev/null || packages+=(libclang-14-dev)
if [ "${1:-}" = training ]; then
    /usr/bin/python3 -c 'import torch' 2>/dev/null || packages+=(python3-torch)
    /usr/bin/python3 -c 'import PIL' 2>/dev/null || packages+=(python3-pil)
    /usr/bin/python3 -c 'import scipy' 2>/dev/null || packages+=(python3-scipy)
fi

if [ ${#packages[@]} -gt 0 ]; then
    echo "setup: installing ${packages[*]}" >&2
    as_root=()
    [ "$(id -u)" -eq 0 ] || as_root=(sudo)
    "${as_root[@]}" apt-get update -qq
    "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "${packages[@]}"
fi

command -v cargo >/dev/null || { echo "setup: no cargo on PATH: install Rust 1.95 or newer with rustup" >&2; exit 1; }
tools/fetch-onnxruntime.sh
