#!/usr/bin/env bash
# Writes docs/evaluation.md: every table of `demeter eval` with its goals, then tools/evaluation-notes.md, what people
# found in the pictures and profiles. Run by `make evaluation` beside ../shared; half an hour on two cores.
#   EVERY=N    takes every N-th cloud and plant, and every 20 N-th for the baselines, which take seconds each
#   HELIOS=F   folder with tools/helios/sets.sh's sets; made with .cache/helios/bin/python where it is missing
#   POISSON=P  a Python with what tools/poisson.py names, for the dense mesh
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
every=${EVERY:-1}
helios=${HELIOS:-.cache/helios/sets}
demeter=target/debug/demeter
[ -d "$helios/clean" ] || tools/helios/sets.sh "$helios" "$(tools/helios/python.sh)" judge

poisson=()
[ -z "${POISSON:-}" ] || poisson=(--poisson "$POISSON")
page=$(mktemp)
{
    cat <<END
# Evaluation

Made by \`make evaluation\` at commit $(git log -1 --format=%h$(git diff --quiet HEAD || echo +changes)), step ${every} through the clouds and plants of each set; definitions are in
spec/reconstruction.md "Metrics", goals in issues 3 and 4. Nothing was learned from shared data that are
for evaluation only; where rules were chosen with them in view, the notes say so. The program is built with the dev profile
(opt-level 3), as everywhere.

## Whole plants

\`demeter eval fit\`: real scans of maize, sorghum, tobacco and tomato (organ-clouds) and one real soybean
(27_o) without labels.

END
    "$demeter" eval fit --every "$every"
    cat <<END

## Beside baselines

The same with \`--baselines\`, step $((20 * every)). SimpleProc is one procedural plant of 8 numbers (the authors' own
for 27_o scores 0.059); Bézier and quadratic are loose surfaces, one for each organ of the same division, that make no
plant; screened Poisson is a dense mesh.

END
    "$demeter" eval fit --every $((20 * every)) --baselines "${poisson[@]}"
    cat <<END

## Single blades

\`demeter eval leaf\`: each leaf of the same scans by itself, base and tip not given.

END
    "$demeter" eval leaf --every "$every"
    for set in clean hard; do
        cat <<END

## Traits, $set

\`demeter eval traits\` on 40 plants of pyhelios3d (tools/helios/sets.sh), labels given, 50,000 points on the solid
surface$([ $set = clean ] || echo "; each coordinate has 5 mm of Gaussian noise and 30 % of the points are missing"). Traits come from the decoded compact record.

END
        "$demeter" eval traits --truth "$helios/$set" --every "$every"
    done
    cat <<END

## Organs

\`demeter eval segment\`: the same scans with their labels hidden, divided by geometry and by geometry and organ3d together;
then plants of pyhelios3d and points of the authors' five plants, which have their stems apart.

END
    "$demeter" eval segment --every "$every"
    "$demeter" eval segment --clouds "$helios/clean" --release ../shared/data/demeter-release/soybean --every $((2 * every))
    cat <<END

## Photos

\`demeter eval photo\`: one picture, one plant (or a row), judged by real photos and silhouettes.

END
    "$demeter" eval photo --every "$every"
    cat <<END

## Depth and camera

\`demeter eval depth\`: organ2d and, for depth, relief2d on single pictures.

END
    "$demeter" eval depth --every "$every"
    cat <<END

## Parents

\`demeter eval topology\` on the clean plants, petioles and branches apart, and on points of the authors' five plants.

END
    "$demeter" eval topology --truth "$helios/clean" --release ../shared/data/demeter-release/soybean
    echo
    cat tools/evaluation-notes.md
} >"$page"
mv "$page" docs/evaluation.md
