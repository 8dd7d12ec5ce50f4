#!/usr/bin/env bash
# Measures out/schedule-record anew: how good runs of different lengths are, with learning rates that follow the length of the run
# and with the same rates in every run. Five lengths, three seeds, four captures: some two hours on two cores that do nothing
# else. Runs that are there are not repeated. $IVV_JOBS says how many are made at a time (default: 2).
#   tools/schedule.sh [FOLDER]     default: out/schedule-record; the runs go to out/schedule
# Real captures and the weights of LPIPS are looked for in $IVV_DATA (default: ../shared/data); what is not there is left out.
set -euo pipefail
if [ $# -gt 1 ] || [[ ${1:-} == -* ]]; then
    echo "usage: tools/schedule.sh [FOLDER]" >&2
    exit 2
fi
record=$(realpath -m "${1:-$(dirname "${BASH_SOURCE[0]}")/../out/schedule-record}")
cd "$(dirname "${BASH_SOURCE[0]}")/.."
source tools/env.sh
build_ivv
out=out/schedule
mkdir -p "$out"
find_data "$out"
lpips_words=${lpips[*]}
export ivv out lpips_words
# Pictures of half the size: those of the full size would take four times as long.
[ -d "$out/synthetic" ] || "$ivv" synth -o "$out/synthetic" --preset hard
[ ! -d "$data/n3v_flame_steak_frame0" ] || [ -f "$out/flame_steak/capture.toml" ] ||
    "$ivv" prepare "$data/n3v_flame_steak_frame0" -o "$out/flame_steak" --images derived_images_4 --scale 0.5 --test-cameras cam00
[ ! -d "$data/panoptic_basketball_dev" ] || [ -f "$out/basketball/capture.toml" ] ||
    "$ivv" prepare "$data/panoptic_basketball_dev" -o "$out/basketball" --scale 0.5 --test-cameras 0,10,15,30

# one CAPTURE NAME STEPS SEED [OPTION...]
one() {
    local capture=$1 name=$2 steps=$3 seed=$4
    shift 4
    local run=$out/runs/$name-$steps-$seed
    [ ! -f "$run/eval.json" ] || return 0
    # Two runs at a time, each in its calling thread, are sooner done than one after the other on two threads.
    # shellcheck disable=SC2086 # the options are words
    LP_NUM_THREADS=${LP_NUM_THREADS:-0} "$ivv" train "$capture" -o "$run" --overwrite --quiet --eval-every 0 \
        --steps "$steps" --seed "$seed" $lpips_words "$@" >/dev/null
    echo "done: $run"
}
export -f one
list() {
    local seed steps
    for seed in 42 43 44; do
        for steps in 100 200 400 800 1600; do
            printf '%s\n' "$data/fox_quarter fox-new $steps $seed" "$data/fox_quarter fox-old $steps $seed --set lr.pace.steps=0"
            for name in flame_steak basketball synthetic; do
                printf '%s\n' "$out/$name $name-new $steps $seed" "$out/$name $name-old $steps $seed --set lr.pace.steps=0"
            done
        done
    done
}
list | while read -r job; do
    if [ -d "${job%% *}" ]; then echo "$job"; fi
done | xargs -P "${IVV_JOBS:-2}" -I{} bash -c 'set -eu; one {}'
"$ivv" compare "$out"/runs/* -o "$record"
