#!/usr/bin/env bash
# Trains a small fixed set of captures with default settings and adds the scores to a history, with a plot: some 12 minutes.
#   tools/quality.sh [HISTORY]     default: assets/quality/history.json; the runs go to out/quality
# Real captures and the weights of LPIPS are looked for in $IVV_DATA (default: ../shared/data); what is not there is left out,
# and the history then has no point for it.
set -euo pipefail
if [ $# -gt 1 ] || [[ ${1:-} == -* ]]; then
    echo "usage: tools/quality.sh [HISTORY]" >&2
    exit 2
fi
history=$(realpath -m "${1:-$(dirname "${BASH_SOURCE[0]}")/../assets/quality/history.json}")
cd "$(dirname "${BASH_SOURCE[0]}")/.."
source tools/env.sh
tools/setup.sh run
own_the_target_folder
cargo build --release --locked
ivv=$CARGO_TARGET_DIR/release/ivv
data=$(realpath -m "${IVV_DATA:-../shared/data}")
out=out/quality
mkdir -p "$out" "$(dirname "$history")"

lpips=()
if [ -d "$data/lpips" ]; then
    python3 tools/lpips_weights.py "$data/lpips/squeeze.backbone.pth" "$data"/lpips/lpips/weights/v0.1/squeeze.pth \
        "$out/lpips.safetensors"
    # Measured, and no part of the loss.
    lpips=(--set loss.lpips=0 --set "loss.lpips_weights=$out/lpips.safetensors")
else
    echo "left out: LPIPS; $data/lpips is not there"
fi

runs=()
# measure NAME CAPTURE OPTION...
measure() {
    local name=$1 capture=$2
    shift 2
    if [ ! -d "$capture" ]; then
        echo "left out: $name; $capture is not there"
        return
    fi
    printf '\n=== %s\n' "$name"
    "$ivv" train "$capture" -o "$out/$name" --overwrite --eval-every 0 "${lpips[@]}" "$@"
    runs+=("$out/$name")
}

"$ivv" synth -o "$out/synthetic" --preset hard
measure demo "$out/synthetic"
measure fox "$data/fox_quarter" --steps 500
measure flame_steak "$data/n3v_flame_steak_frame0" --images derived_images_4 --test-cameras cam00 --steps 500
measure basketball "$data/panoptic_basketball_dev" --test-cameras 0,10,15,30 --steps 600
printf '\n'
"$ivv" compare "${runs[@]}" --history "$history"
printf '\nthe history: %s; its plot: %s\n' "$history" "${history%.json}.svg"
