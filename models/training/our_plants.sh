#!/usr/bin/env bash
# Labelled clouds of plants of every species that ships, young and old, for organ3d.
# Usage: models/training/our_plants.sh DEMETER FOLDER
set -euo pipefail
demeter=$1 folder=$2 seed=5000
for species in soybean maize sorghum tobacco tomato bean cowpea pepper; do
    seed=$((seed + 1))
    common="--species $species --points 16000 --noise 0"
    "$demeter" synth clouds $common --count 36 --age 0.9 --seed $seed -o "$folder/$species"
    "$demeter" synth clouds $common --count 16 --age 0.1 --seed $((seed + 100)) -o "$folder/young_$species"
done
echo "{\"seed\": 5001, \"program\": \"$("$demeter" --version)\"}" > "$folder/meta.json"
