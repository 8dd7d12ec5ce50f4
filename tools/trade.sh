#!/usr/bin/env bash
# Measures assets/trade anew, in an hour of one core: settings with three seeds, presets alone with twelve.
#   tools/trade.sh [FOLDER] [OPTION...]    default: assets/trade; options go to `ivv trade`
set -euo pipefail
if [[ ${1:-} == -* ]]; then
    echo "usage: tools/trade.sh [FOLDER] [OPTION...]" >&2
    exit 2
fi
cd "$(dirname "${BASH_SOURCE[0]}")/.."
record=${1:-assets/trade}
[ $# -eq 0 ] || shift
source tools/env.sh
build_ivv
# Pictures this small are soonest done in the calling thread: lavapipe takes 11 us for a dispatch there and 70 us to wake another.
export LP_NUM_THREADS=${LP_NUM_THREADS:-0}
out=out/trade
"$ivv" synth -o "$out/small" --preset small --offsets
# measure NAME OPTION...: short runs of few images with default settings. cam05 stands among the training cameras, cam09 apart
# from them.
measure() {
    local name=$1
    shift
    "$ivv" trade "$out/small" -o "$out/$name" --steps 240 --test-cameras cam05 "$@"
    mkdir -p "$record"
    for kind in md json svg; do cp "$out/$name/trade.$kind" "$record/$name.$kind"; done
}
measure trade --seeds 4,5,6 "$@"
measure presets --only-presets --seeds 1,2,3,4,5,6,7,8,9,10,11,12 "$@"
