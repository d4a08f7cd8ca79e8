#!/usr/bin/env bash
# Makes what organ2d learns from: FOLDER/assets (plants of pyhelios3d and leaf pictures, half an hour) and COUNT pictures of
# the synthetic world in FOLDER/images, 0.1 s each. A stopped run continues with the assets it has.
# Usage: tools/training-pictures.sh FOLDER COUNT
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
folder=$1
count=$2
python=$(tools/helios/python.sh)
leaflets=()
[ ! -d ../shared/data/soybean-leaflets ] || leaflets=(--leaflets ../shared/data/soybean-leaflets)
[ -f "$folder/assets/meta.json" ] ||
    $python tools/helios/meshes.py --each 26 --seed 6000 "${leaflets[@]}" -o "$folder/assets"
rm -rf "$folder/images.new"
target/debug/demeter synth images --assets "$folder/assets" --count "$count" --size 320 --seed 1 -o "$folder/images.new"
mv "$folder/images.new" "$folder/images"
