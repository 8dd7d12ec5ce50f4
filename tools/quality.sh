#!/usr/bin/env bash
# Trains on a small fixed set of captures with default settings and adds the scores to a history, with a plot: some 10 minutes.
#   tools/quality.sh [HISTORY]     default: assets/quality/history.json; the runs go to out/quality
# Real captures and the weights of LPIPS are looked for in $IVV_DATA (default: ../shared/data); what is not there is left out.
set -euo pipefail
if [ $# -gt 1 ] || [[ ${1:-} == -* ]]; then
    echo "usage: tools/quality.sh [HISTORY]" >&2
    exit 2
fi
history=$(realpath -m "${1:-$(dirname "${BASH_SOURCE[0]}")/../assets/quality/history.json}")
cd "$(dirname "${BASH_SOURCE[0]}")/.."
source tools/env.sh
build_ivv
out=out/quality
mkdir -p "$out" "$(dirname "$history")"
find_data "$out"

runs=()
# measure NAME CAPTURE OPTION...
measure() {
    local name=$1 capture=$2
    shift 2
    if [ ! -d "$capture" ]; then
        echo "left out: $name; $capture is not there"
        return
    fi
    runs+=("$out/$name")
    printf '\n=== %s\n' "$name"
    "$ivv" train "$capture" -o "$out/$name" --overwrite --eval-every 0 "${lpips[@]}" "$@"
}

"$ivv" synth -o "$out/synthetic" --preset hard
measure demo "$out/synthetic"
measure fox "$data/fox_quarter" --steps 500
measure flame_steak "$data/n3v_flame_steak_frame0" --images derived_images_4 --test-cameras cam00 --steps 500
measure basketball "$data/panoptic_basketball_dev" --test-cameras 0,10,15,30 --steps 600
"$ivv" bench --runs "${runs[@]}" --history "$history"
printf '\nthe history: %s; its plot: %s\n' "$history" "${history%.json}.svg"
