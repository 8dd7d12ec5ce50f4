#!/usr/bin/env bash
# Measures assets/trade anew, in 20 to 30 minutes on two cores that do nothing else.
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
tools/setup.sh run
own_the_target_folder
cargo build --release --locked
ivv=$CARGO_TARGET_DIR/release/ivv
out=out/trade
"$ivv" synth -o "$out/small" --preset small --offsets
# A short run of few images, as tools/demo.sh has it.
"$ivv" trade "$out/small" -o "$out/runs" --steps 400 --max-gaussians 6000 --set density.growth=0.5 \
    --set lr.position.start=4.8e-4 --set lr.position.end=4.8e-6 --set lr.offset=3e-3 --set loss.flow=0.1 \
    --set grids=false "$@"
mkdir -p "$record"
cp "$out/runs/trade.md" "$out/runs/trade.json" "$out/runs/trade.svg" "$record"
