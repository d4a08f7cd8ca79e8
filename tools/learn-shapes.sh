#!/usr/bin/env bash
# Leaf shapes of every species that ships, into FOLDER/NAME.safetensors: the first half of `make species`, which
# learn-species.sh finishes with bends. Learns from ../shared/data and from the leaf scans inside pyhelios3d.
# usage: learn-shapes.sh FOLDER PYTHON (one that has pyhelios3d)
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
demeter=target/debug/demeter
folder=$1 python=$2
package=$("$python" -c 'import importlib.util as u; print(u.find_spec("pyhelios").submodule_search_locations[0])')
scans=$package/assets/build/plugins/plantarchitecture/assets/textures
helios="leaf scans of pyhelios3d 0.1.38, MIT and LGPL-2.1+"
soybean=$folder/soybean.safetensors
mkdir -p "$folder"

# shape SPECIES CREDIT ARGUMENTS..: the report goes beside the file.
shape() {
    local species=$1 credit=$2
    shift 2
    "$demeter" learn shape "$@" --from "generic:$species" --credit "$credit" \
        -o "$folder/$species.safetensors" >"$folder/$species-shape.log"
    grep -- "scans kept" "$folder/$species-shape.log"
}

shape soybean "soybean leaflets, MIT, (c) 2020 Kayran Santos" ../shared/data/soybean-leaflets/mask --base top
# One to four scans each: their mean, with soybean's components beside their own deviations.
shape bean "$helios" --related "$soybean" --base left \
    "$scans"/BeanLeaf_{left_centered,right_centered,tip,unifoliate_centered}.png
shape cowpea "$helios" --related "$soybean" --base left \
    "$scans"/CowpeaLeaf_{left_centered,right_centered,tip_centered,unifoliate_centered}.png
shape pepper "$helios" --related "$soybean" --base left "$scans/CapsicumLeaf.png"
# Two scans of a leaflet; TomatoLeaf.png is half a compound leaf.
shape tomato "$helios" --related "$soybean" --base left "$scans"/{TomatoLeaf_blade,CherryTomatoLeaf}.png
# No scan of tobacco may ship, and no leaf of what may is shaped like one: the hand-made ovals stay.
"$demeter" species export generic:tobacco -o "$folder/tobacco.safetensors"
# The one strap leaf; the width of each blade is s_x, the other components are the generic ones of grasses.
shape sorghum "$helios" --base left "$scans/SorghumLeaf.png"
shape maize "$helios" --base left "$scans/SorghumLeaf.png"
