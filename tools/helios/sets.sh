#!/usr/bin/env bash
# Grows the three sets of labelled plants into FOLDER: `clean` and `hard` (40 plants each, the same ones; hard has 5 mm
# of noise and 30 % of its points missing) judge the fit, `train` (48 plants of 8 species) is what may be learned from.
# Usage: tools/helios/sets.sh FOLDER [PYTHON [judge|train]], PYTHON having tools/helios/requirements.txt installed;
# without a third word both are grown.
set -euo pipefail
folder=$1
python=${2:-.cache/helios/bin/python}
which=${3:-both}
grow="$python $(dirname "${BASH_SOURCE[0]}")/grow.py"

# Ages in days from the first to the last at which a plant has 4 to 80 blades and no flower yet.
declare -A first=([soybean]=12 [maize]=18 [bean]=7 [sorghum]=20 [cowpea]=8 [tomato]=6 [pepper]=30 [sugarbeet]=10)
declare -A last=([soybean]=26 [maize]=48 [bean]=18 [sorghum]=50 [cowpea]=18 [tomato]=16 [pepper]=60 [sugarbeet]=40)

# age SPECIES K N: the K-th of N ages.
age() { echo $((first[$1] + (last[$1] - first[$1]) * $2 / ($3 - 1))); }

if [ "$which" != train ]; then
    for species in soybean maize bean sorghum; do
        for k in {0..9}; do
            plant="--species $species --seed $((1000 + k)) --age $(age $species "$k" 10)"
            $grow $plant -o "$folder/clean"
            $grow $plant -o "$folder/hard" --noise-mm 5 --missing 0.3
        done
    done
fi
if [ "$which" != judge ]; then
    for species in soybean maize bean sorghum cowpea tomato pepper sugarbeet; do
        for k in {0..5}; do
            $grow --species $species --seed $((1 + k)) --age "$(age $species "$k" 6)" --points 20000 -o "$folder/train"
        done
    done
fi
