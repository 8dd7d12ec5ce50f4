#!/usr/bin/env bash
# Sets up, builds, and renders the scene that the project ships, from 8 views, to PNG and EXR.
#   tools/demo.sh [OUT]      default: ./out
set -euo pipefail
if [ $# -gt 1 ] || [[ ${1:-} == -* ]]; then
    echo "usage: tools/demo.sh [OUT]" >&2
    exit 2
fi
out=$(realpath -m "${1:-out}")
cd "$(dirname "${BASH_SOURCE[0]}")/.."
[ $# -gt 0 ] || out=$PWD/out
source tools/env.sh

tools/setup.sh run
own_the_target_folder
cargo build --release --locked
"$CARGO_TARGET_DIR/release/ivv" render --scene assets/demo/scene.ply --cameras assets/demo/cameras.json \
    -o "$out" --format png,exr
printf '\nthe demo scene, 8 views, in %s:\n' "$out"
ls -1 "$out"
