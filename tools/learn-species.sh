#!/usr/bin/env bash
# Remakes recon/species/*.safetensors.gz from ../shared/data and from plants of pyhelios3d: `make species`, or with names of
# species only those. Two runs on one machine write the same bytes. docs/species.md says what each learns from and why.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
demeter=target/debug/demeter
data=../shared/data
cache=.cache/species
plants=$cache/train
leaves="$data/leaf-clouds/soybean/*.txt $data/leaf-clouds/sugarbeet/*.txt"
[ -d "$data" ] || { echo "learn-species: expected $data, found none" >&2; exit 1; }

helios="pyhelios3d 0.1.38 (MIT, LGPL-2.1+)"
scans="leaf scans (MIT, (c) 2020 oceam)"

mkdir -p "$cache/learned" recon/species
python=$(tools/helios/python.sh)
if [ ! -f "$plants/complete" ]; then
    tools/helios/sets.sh "$cache" $python train
    touch "$plants/complete"
fi
tools/learn-shapes.sh "$cache" $python

# bends SPECIES CREDIT CLOUDS.. [OPTIONS..]: joint angles and priors on top of the shape in $cache/SPECIES.safetensors.
bends() {
    local species=$1 credit=$2
    shift 2
    # Exit code 3 says that some clouds taught nothing; the log says which and why.
    "$demeter" learn deform "$@" --from "$cache/$species.safetensors" -o "$cache/learned/$species.safetensors" \
        --credit "$credit" >"$cache/$species.log" || [ $? = 3 ]
    # Neither name nor time: the same species packs into the same bytes.
    gzip -9nc "$cache/learned/$species.safetensors" >"recon/species/$species.safetensors.gz"
    tail -n 1 "$cache/$species.log"
}

learn() {
    case $1 in
    soybean | bean | cowpea | pepper | tomato) bends "$1" "$helios; $scans" $plants/"$1"_*.ply $leaves ;;
    maize | sorghum) bends "$1" "$helios" $plants/"$1"_*.ply ;;
    # No tobacco may ship: its bends are those of simple broad leaves, and more of them as its shape has fewer components.
    tobacco)
        bends tobacco "$helios, sugar beet and pepper; $scans" $plants/{sugarbeet,pepper}_*.ply $leaves --components 30
        ;;
    *)
        echo "learn-species: expected one of the eight species, found $1" >&2
        exit 2
        ;;
    esac
}

[ $# -gt 0 ] || set -- soybean maize sorghum tobacco tomato bean cowpea pepper
for species; do learn "$species"; done
