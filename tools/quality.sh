#!/usr/bin/env bash
# Measures what a small fixed set of captures is worth.
#   tools/quality.sh [HISTORY]           trains on them with default settings and adds the scores to a history, with a plot: some
#                                        10 minutes. Default: assets/quality/history.json; the runs go to out/quality
#   tools/quality.sh --study [FOLDER]    techniques beside the default, three seeds each, on captures of half the size: two to three
#                                        hours on two cores that do nothing else. Runs that are there are not repeated. FOLDER/standings.md
#                                        tells what is shown. Default: out/study. $IVV_STEPS: steps of a run (default: 600).
#                                        $IVV_JOBS: captures at a time (default: 2)
#   tools/quality.sh --curves [FOLDER]   what presets reach in 30 s to 10 minutes on the real captures, three seeds each: a night and
#                                        a day on two cores. Runs that are there are not repeated. FOLDER/curves/curves.md has the tables.
#                                        Default: out/study. $IVV_SECONDS: the times instead, such as 30,60
#   tools/quality.sh --trade [FOLDER]    what settings cost and buy: each alone, presets, and `fast` without each of its settings, on the
#                                        real captures with three seeds: an hour of one core for each capture. Other work on the
#                                        machine slows all settings equally. Runs that are there are not repeated. Default: out/trade
#   tools/quality.sh --playback [FOLDER] what the settings of a frame cost and buy on the trained scenes of out/quality, which are trained
#                                        where they are not there: some 5 minutes. Default: out/trade, playback.md
# Real captures and the weights of LPIPS are looked for in $IVV_DATA (default: ../shared/data); what is not there is left out.
set -euo pipefail
what=history
case "${1:-}" in --study | --curves | --trade | --playback)
    what=${1#--}
    shift
    ;;
esac
if [ $# -gt 1 ] || [[ ${1:-} == -* ]]; then
    echo "usage: tools/quality.sh [HISTORY] | --study [FOLDER] | --curves [FOLDER] | --trade [FOLDER] | --playback [FOLDER]" >&2
    exit 2
fi
given=${1:+$(realpath -m "$1")}
cd "$(dirname "${BASH_SOURCE[0]}")/.."
source tools/env.sh
build_ivv

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
    [ "$what" = history ] || [ ! -f "$out/$name/eval.json" ] || return 0
    printf '\n=== %s\n' "$name"
    "$ivv" train "$capture" -o "$out/$name" --overwrite --eval-every 0 "${lpips[@]}" "$@"
}

# The real captures with their default settings.
measure_real() {
    measure fox "$data/fox_quarter" --steps 500
    measure flame_steak "$data/n3v_flame_steak_frame0" --images derived_images_4 --test-cameras cam00 --steps 500
    measure basketball "$data/panoptic_basketball_dev" --test-cameras 0,10,15,30 --steps 600
}

history() {
    local history=${given:-$PWD/assets/quality/history.json}
    out=out/quality
    mkdir -p "$out" "$(dirname "$history")"
    find_data "$out"
    "$ivv" synth -o "$out/synthetic" --preset hard
    measure demo "$out/synthetic"
    measure_real
    printf '\n'
    "$ivv" compare "${runs[@]}" --history "$history"
    printf '\nthe history: %s; its plot: %s\n' "$history" "${history%.json}.svg"
}

captures=()
# prepared NAME SOURCE OPTION...: half the size, since the full one would take four times as long.
prepared() {
    local name=$1 source=$data/$2
    shift 2
    if [ ! -d "$source" ]; then
        echo "left out: $name; $source is not there"
        return
    fi
    [ -f "$out/captures/$name/capture.toml" ] || "$ivv" prepare "$source" -o "$out/captures/$name" --scale 0.5 "$@"
    captures+=("$out/captures/$name")
}

# ablate FOLDER CAPTURE...
ablate() {
    local folder=$1
    shift
    # shellcheck disable=SC2086 # the options are words
    "$ivv" ablate "$@" -o "$folder" $study_options
}

# The real captures that are there: fox as it is, the others at half their size. Sets $weights, the options that measure LPIPS.
real_captures() {
    local option
    out=${given:-$PWD/out/study}
    mkdir -p "$out/captures"
    find_data "$out"
    weights=
    for option in "${lpips[@]}"; do
        [[ $option != loss.lpips_weights=* ]] || weights="--lpips-weights ${option#*=}"
    done
    [ ! -d "$data" ] || tools/setup.sh prepare
    if [ -d "$data/fox_quarter" ]; then captures+=("$data/fox_quarter"); fi
    prepared flame_steak n3v_flame_steak_frame0 --images derived_images_4 --test-cameras cam00
    prepared basketball panoptic_basketball_dev --test-cameras 0,10,15,30
}

curves() {
    real_captures
    # shellcheck disable=SC2086 # the options are words
    "$ivv" curves "${captures[@]}" -o "$out/curves" --seconds "${IVV_SECONDS:-30,60,120,300,600}" $weights
}

trade() {
    local record=${given:-$PWD/out/trade} capture name kind
    given=
    real_captures
    mkdir -p "$record"
    # Pictures this small are soonest done in the calling thread: lavapipe takes 11 us for a dispatch there and 70 us to wake another.
    export LP_NUM_THREADS=${LP_NUM_THREADS:-0}
    for capture in "${captures[@]}"; do
        name=$(basename "$capture")
        "$ivv" trade "$capture" -o "$out/trade/$name" --steps 240
        for kind in md json svg; do cp "$out/trade/$name/trade.$kind" "$record/$name.$kind"; done
    done
}

# Of a clip one camera.
playback() {
    local record=${given:-$PWD/out/trade} run
    out=out/quality
    mkdir -p "$out" "$record"
    find_data "$out"
    measure_real
    {
        echo "# What the settings of a frame cost and buy"
        printf '\n%s\n' "Trained scenes, on $("$ivv" --json devices | sed -n 's/.*"name": *"\([^"]*\)".*/\1/p' | head -1), $(date +%F). Times are taken in turn with those of \`as given\`; errors are those of the worst picture. The rows were measured at different times, so compare speeds, not milliseconds."
        for run in "${runs[@]}"; do
            printf '\n## %s\n\n' "$(basename "$run")"
            case "$run" in
                */basketball) "$ivv" render "$run" --camera 10 --bench 0.1 --each-knob ;;
                *) "$ivv" render "$run" --bench 0.1 --each-knob ;;
            esac
        done
    } >"$out/playback.md"
    mv "$out/playback.md" "$record/playback.md"
    echo "$record/playback.md"
}

study() {
    local rig
    real_captures
    prepared basketball_90 panoptic_basketball_90 --test-cameras 0,10,15,30
    for rig in inward outward moving; do
        [ -d "$out/captures/$rig" ] || "$ivv" synth -o "$out/captures/$rig" --preset study --rig "$rig"
        captures+=("$out/captures/$rig")
    done
    study_options="--studies quality,clips --bases given --steps ${IVV_STEPS:-600} $weights"
    export ivv study_options out
    export -f ablate
    # Two captures at a time, each run in its calling thread, are sooner done than one run after the other on two threads.
    printf '%s\n' "${captures[@]}" | LP_NUM_THREADS=${LP_NUM_THREADS:-0} xargs -P "${IVV_JOBS:-2}" -I{} \
        bash -c 'set -eu; ablate "$out/$(basename {})" {} --json >/dev/null'
    ablate "$out" "${captures[@]}"
}

$what
