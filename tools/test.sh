#!/usr/bin/env bash
# Sets up and runs the tests. Every lane has the validation layer on, and any message fails it.
#   tools/test.sh [ARGS]           the default device
#   tools/test.sh --slow [ARGS]    the other lanes: subgroups of 4 and 16, emulated ones of 32 and 64, one thread, no push
#                                  descriptors, synchronisation validation, roundings and orders of work of other
#                                  devices, accesses out of bounds, the long tests (with faults of the device at many
#                                  calls), SwiftShader, mutations
#   tools/test.sh --player         the browser player in Chromium: files, pictures against the engine's, page, sound, headset
#   tools/test.sh --play           the window of `ivv-play` under Xvfb: pictures, resizes, faults of the surface, sound
#   tools/test.sh --manual         every command of the README and the manual, on a small synthetic capture
#   tools/test.sh --cluster        the jobs of a long clip under Snakemake and Slurm, with one that is killed, and on a full disk
#   tools/test.sh --mpi            a training by several processes under mpirun: the same bytes, also where some are killed
#   tools/test.sh --budgets        what compilers of AMD's and NVIDIA's chips make of the kernels, against assets/gpu/budgets.tsv;
#                                  needs no GPU. IVV_BLESS=1 writes the table
#   tools/test.sh --fuzz [SECONDS] damaged files for every reader, for SECONDS in all; by default an hour
# ARGS go to cargo test.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
source tools/env.sh

if [ "${1:-}" = --fuzz ]; then
    tools/setup.sh test
    own_the_target_folder
    exec env IVV_FUZZ_SECONDS="${2:-3600}" cargo test --locked --profile fuzz --test it -- fuzz:: --nocapture
fi
if [ "${1:-}" = --player ]; then
    tools/setup.sh player
    build_ivv
    IVV=$ivv IVV_NODE_MODULES=$cache/player/node_modules exec \
        node --test --test-concurrency=1 tests/player/*.test.mjs
fi
if [ "${1:-}" = --play ]; then
    tools/setup.sh play
    own_the_target_folder
    # Its tests compare with what `ivv render` writes.
    cargo build --locked
    exec cargo test --locked --package ivv-play
fi
if [ "${1:-}" = --manual ]; then
    tools/setup.sh manual
    build_ivv
    exec tools/manual.sh run "$ivv"
fi
if [ "${1:-}" = --cluster ]; then
    tools/setup.sh cluster
    build_ivv
    exec tests/cluster.sh "$ivv" "$cache/cluster/bin/snakemake"
fi
if [ "${1:-}" = --mpi ]; then
    tools/setup.sh mpi
    build_ivv --features mpi
    exec tests/mpi.sh "$ivv"
fi
if [ "${1:-}" = --budgets ]; then
    tools/setup.sh test
    build_ivv --package ivv-gpu-model
    if ! tools/gpu/statistics.sh "$CARGO_TARGET_DIR/release/ivv-gpu-model" "$CARGO_TARGET_DIR/tmp/gpu"; then
        echo "test.sh: skipped: the drivers cannot be had, as told above"
        exit 0
    fi
    export IVV_BUDGETS="$CARGO_TARGET_DIR/tmp/gpu"
    exec cargo test --locked --test it -- repo::budgets --ignored --nocapture
fi
slow=no
if [ "${1:-}" = --slow ]; then
    slow=yes
    shift
fi
arguments=("$@")

passed=0
failed=0
skipped=0

# lane NAME COMMAND...
lane() {
    local name=$1 start=$SECONDS
    shift
    printf '\n=== lane: %s\n' "$name"
    if "$@"; then
        passed=$((passed + 1))
        printf '=== passed: %s (%d s)\n' "$name" $((SECONDS - start))
    else
        failed=$((failed + 1))
        printf '=== FAILED: %s (%d s)\n' "$name" $((SECONDS - start))
    fi
}

# skip NAME REASON
skip() {
    skipped=$((skipped + 1))
    printf '\n=== skipped: %s: %s\n' "$1" "$2"
}

# Crates with tests that need no display.
packages=(--package ivv --package ivv-gpu-model)

tests() {
    cargo test --locked "${packages[@]}" "${arguments[@]}" "$@"
}

# Modules that run kernels. Other lanes repeat these alone: readers, pages and sound know no device.
on_device=(kernel:: grad:: render:: extreme:: profile:: screen::device)

# kernels VARIABLE=VALUE... [MODULE...]: what runs kernels, and further modules.
kernels() (
    while [[ ${1:-} == *=* ]]; do
        export "${1?}"
        shift
    done
    if [ ${#arguments[@]} -gt 0 ]; then tests; else tests --test it -- "${on_device[@]}" "$@"; fi
)

# The tests marked #[ignore = "slow: ..."], and no others.
long_tests() {
    case " ${arguments[*]} " in
        *" -- "*) tests --ignored ;;
        *) tests -- --ignored ;;
    esac
}

# Out of Debian's chromium-common, unpacked below the cache folder and not installed: Google's software driver, and a
# validation layer years newer than Debian's, which sees hazards between dispatches. Prints the folder or, on failure, the
# reason.
chromium() {
    local folder=$cache/chromium from=usr/lib/chromium temporary
    if [ -f "$folder/VkLayer_khronos_validation.json" ]; then
        echo "$folder"
        return
    fi
    if ! command -v apt-get >/dev/null || ! command -v dpkg >/dev/null; then
        echo "this is not Debian"
        return 1
    fi
    mkdir -p "$folder" && temporary=$(mktemp -d "$folder/download.XXXXXX") || return 1
    # Not as `_apt`, the user that apt downloads as: it need not be able to write here.
    if ! (cd "$temporary" && apt-get -o APT::Sandbox::User=root download chromium-common) >"$folder/log" 2>&1; then
        echo "chromium-common cannot be downloaded: $(tail -n 1 "$folder/log")"
    elif ! dpkg -x "$temporary"/*.deb "$temporary/x" ||
        ! (cd "$temporary/x/$from" &&
            mv libvk_swiftshader.so vk_swiftshader_icd.json libVkLayer_khronos_validation.so "$folder/"); then
        echo "chromium-common holds no SwiftShader or no validation layer"
    else
        # The manifest last: its presence says that the folder is complete.
        cat >"$folder/VkLayer_khronos_validation.json" <<EOT
{"file_format_version": "1.2.0", "layer": {"name": "VK_LAYER_KHRONOS_validation", "type": "GLOBAL",
 "library_path": "./libVkLayer_khronos_validation.so", "api_version": "1.3.280", "implementation_version": "1",
 "description": "Khronos validation layer of Debian's chromium"}}
EOT
    fi
    rm -rf "$temporary"
    [ -f "$folder/VkLayer_khronos_validation.json" ] && echo "$folder"
}

# Tests note there what did not run and what is out of date: tests/common/notes.rs.
notes=$CARGO_TARGET_DIR/tmp/test-notes.tsv

# told KIND WHAT: the notes of a kind, each reason once, with how often it was noted and by how many tests.
told() {
    local what=$2
    awk -F '\t' -v kind="$1" -v what="$what" '
        $1 == kind {
            n[$3]++
            total++
            if (!(($3, $2) in seen)) { seen[$3, $2] = 1; tests[$3]++; if (tests[$3] <= 3) names[$3] = names[$3] ", " $2 }
        }
        END {
            printf "\n=== %d %s\n", total, what
            for (reason in n) {
                more = tests[reason] > 3 ? sprintf(" and %d more", tests[reason] - 3) : ""
                printf "%5d x %s (%s%s)\n", n[reason], reason, substr(names[reason], 3), more | "sort -rn"
            }
        }' "$notes"
}

tools/setup.sh test
own_the_target_folder
cargo test --locked "${packages[@]}" --no-run
mkdir -p "${notes%/*}" && : >"$notes"
if [ $slow = no ]; then
    lane "default device" tests
else
    # These variables are lavapipe's; a GPU would not notice them.
    lane "lavapipe, subgroups of 4" kernels IVV_TEST_DEVICE=llvmpipe LP_NATIVE_VECTOR_WIDTH=128 train::
    lane "lavapipe, subgroups of 16" kernels IVV_TEST_DEVICE=llvmpipe LP_NATIVE_VECTOR_WIDTH=512 train::
    # Without training, which has the same kernels and takes long there.
    for lanes in 32 64; do
        if [[ $(cargo run --locked --quiet -- devices) == *"llvmpipe Mesa 22."* ]]; then
            lane "lavapipe, emulated subgroups of $lanes" kernels IVV_TEST_DEVICE=llvmpipe IVV_TEST_REWRITE="lanes$lanes"
        else
            skip "lavapipe, emulated subgroups of $lanes" "this needs lavapipe of Mesa 22"
        fi
    done
    lane "lavapipe, one thread" kernels IVV_TEST_DEVICE=llvmpipe LP_NUM_THREADS=1 train::
    lane "no push descriptors" kernels IVV_TEST_NO_PUSH_DESCRIPTORS=1 train::
    lane "synchronisation validation" kernels IVV_TEST_SYNC_VALIDATION=1 train::
    lane "roundings of other devices" kernels IVV_TEST_REWRITE=numeric train::
    lane "work in another order" kernels IVV_TEST_REWRITE=order train::
    lane "accesses out of bounds" kernels IVV_TEST_REWRITE=bounds train::
    lane "long tests" long_tests
    if folder=$(chromium); then
        lane "synchronisation between dispatches" kernels VK_LAYER_PATH="$folder" IVV_TEST_SYNC_VALIDATION=1 \
            VK_KHRONOS_VALIDATION_VALIDATE_SYNC=1 VK_KHRONOS_VALIDATION_SYNCVAL_SHADER_ACCESSES_HEURISTIC=true train::
        manifest=$folder/vk_swiftshader_icd.json
        # Loaders before 1.3.207 know only the second name.
        lane "SwiftShader" kernels VK_DRIVER_FILES="$manifest" VK_ICD_FILENAMES="$manifest" train::
    else
        skip "synchronisation between dispatches" "$folder"
        skip "SwiftShader" "$folder"
    fi
    lane "mutations" tools/mutants.sh
fi
told skipped "skips: tests, or cases of them, that did not run in a lane that passed"
told stale "notes of shipped measurements that are out of date"
printf '\nlanes: %d passed, %d failed' $passed $failed
[ $skipped -eq 0 ] || printf ', %d skipped' $skipped
printf '\n'
[ $failed -eq 0 ]
