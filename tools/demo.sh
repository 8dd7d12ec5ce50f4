#!/usr/bin/env bash
# Sets up, builds, makes a small synthetic capture, trains on it and scores it on cameras that training has not seen.
#   tools/demo.sh [OUT]      default: ./out; the capture goes to OUT/capture, the run to OUT/run
set -euo pipefail
if [ $# -gt 1 ] || [[ ${1:-} == -* ]]; then
    echo "usage: tools/demo.sh [OUT]" >&2
    exit 2
fi
out=$(realpath -m "${1:-out}")
cd "$(dirname "${BASH_SOURCE[0]}")/.."
[ $# -gt 0 ] || out=$PWD/out
source tools/env.sh

build_ivv
# Eight cameras whose clocks and colours differ, with priors of depth and flow; two more are held out.
"$ivv" synth -o "$out/capture" --preset hard
"$ivv" train "$out/capture" -o "$out/run" --overwrite
cat <<EOT

The report, for any browser: $out/run/report.html
The scene: $out/run/scene.ply; the test views: $out/run/renders

With a capture of your own (images and a COLMAP model in sparse/0; \`ivv check\` names other formats and every fault):
  $ivv check CAPTURE
  $ivv train CAPTURE -o RUN
  $ivv export RUN -o scene.html
EOT
