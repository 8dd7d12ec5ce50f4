#!/usr/bin/env bash
# A training by several processes on one machine: the same bytes by one, two and four of them, and after one of them, or all, are
# killed. Takes a program built with the feature `mpi`, and mpirun.
#   tests/mpi.sh IVV
set -euo pipefail
ivv=$(realpath "$1")
work=$(mktemp -d "${TMPDIR:-/tmp}/ivv-mpi.XXXXXX")
trap 'rm -rf "$work"' EXIT
cd "$work"
# More processes than cores, and by root, as in a container; time to write a checkpoint before the launcher kills.
export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1 OMPI_MCA_rmaps_base_oversubscribe=1
export OMPI_MCA_odls_base_sigkill_timeout=2 LP_NUM_THREADS=1

fail() {
    echo "mpi: FAILED: $*" >&2
    exit 1
}
steps=120
# begin RUN N: N processes in the background, whose log is RUN.log. Sets $running.
begin() {
    mpirun -n "$2" "$ivv" --quiet train capture --set batch=4 --steps $steps --seed 3 --checkpoint-every 10 -o "$1" >"$1.log" 2>&1 &
    running=$!
}
resume() { mpirun -n "$2" "$ivv" --quiet train --resume -o "$1" >>"$1.log" 2>&1 || fail "cannot go on: $(cat "$1.log")"; }
newest() { find "$1/checkpoints" -name '*.ckpt' ! -name 'best*' 2>/dev/null | sort | tail -n 1; }
same() { cmp -s "$1/scene.ply" alone/scene.ply || fail "$1: the scene is not that of one process"; }
told() { grep '"loss"' "$1/train.jsonl" | sed 's/"[a-z_]*seconds[a-z_]*":[^,}]*//g; s/"waited_for_images_s":[^,}]*//g' | sort -u; }
# wait_for RUN: until it has a checkpoint after the first.
wait_for() {
    for _ in $(seq 600); do
        if [[ $(newest "$1") == *0[1-9]0.ckpt ]]; then return; fi
        kill -0 $running 2>/dev/null || fail "$1 ended too soon: $(cat "$1.log")"
        sleep 0.1
    done
    fail "$1 has no checkpoint: $(cat "$1.log")"
}

"$ivv" --quiet synth --preset tiny --frames 8 -o capture >/dev/null
"$ivv" --quiet train capture --set batch=4 --steps $steps --seed 3 --checkpoint-every 10 -o alone >/dev/null
for n in 1 2 4; do
    begin "by-$n" $n
    wait $running || fail "$n processes: $(cat "by-$n.log")"
    same "by-$n"
    # What was logged of each step, but for the seconds.
    diff <(told alone) <(told "by-$n") >"by-$n.diff" || fail "$n processes: steps told otherwise: $(head -n 4 "by-$n.diff")"
done
echo "mpi: the same scene and the same steps by one, two and four processes"

begin odd 3
if wait $running; then fail "three processes shared four images"; fi
grep -q "batch is 4, and 3 processes share" odd.log || fail "three processes are refused with: $(cat odd.log)"

# A process that is lost ends the others, which leave what they have; another number of them goes on.
begin killed 2
wait_for killed
victim=$(pgrep -P $running -f "train capture" | tail -n 1)
kill -9 "$victim"
if wait $running; then fail "nobody noticed a process that was killed"; fi
[ ! -e killed/scene.ply ] || fail "there is a scene after a process was killed: more than $steps steps are needed"
grep -q "holds step" killed.log || fail "the process that is left says: $(cat killed.log)"
resume killed 4
same killed
echo "mpi: a process killed, four went on, the same scene"

begin stopped 2
wait_for stopped
kill -TERM $running
if wait $running; then fail "an interrupted training ended as if it were done"; fi
grep -q "continue with --resume" stopped.log || fail "an interruption is told as: $(cat stopped.log)"
resume stopped 1
same stopped
echo "mpi: interrupted, one process went on, the same scene"

begin lost 2
wait_for lost
pkill -9 -P $running || true
kill -9 $running
wait $running || true
sleep 0.5
resume lost 2
same lost
echo "mpi: all killed, two went on, the same scene"
