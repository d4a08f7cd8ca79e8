#!/usr/bin/env bash
# Makes what organ3d learns from in FOLDER: clouds of pyhelios3d's plants (half an hour), of our own and of seedlings by rule.
# Usage: tools/training-clouds.sh FOLDER
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
folder=$1
rm -rf "$folder.new"
mkdir -p "$folder.new"
python=$(tools/helios/python.sh)
$python tools/helios/flock.py --each 100 --seed 5000 -o "$folder.new/helios"
models/training/our_plants.sh target/debug/demeter "$folder.new/demeter"
/usr/bin/python3 models/training/seedlings.py --count 800 --seed 5000 -o "$folder.new/seedlings"
mv "$folder.new" "$folder"
