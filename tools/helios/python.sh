#!/usr/bin/env bash
# Prints the Python that has tools/helios/requirements.txt installed; makes it where it is missing.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
python=.cache/helios/bin/python
[ -x $python ] || {
    python3 -m venv .cache/helios
    $python -m pip install --quiet -r tools/helios/requirements.txt
} >&2
echo $python
