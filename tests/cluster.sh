#!/usr/bin/env bash
# The jobs of a long clip on a cluster of one machine: Snakemake with a job that is killed, Slurm, and a disk that is full.
# All of them must give the bytes that `ivv segments run` gives alone. Needs root for Slurm and the disk.
#   tests/cluster.sh IVV SNAKEMAKE
set -euo pipefail
ivv=$(realpath "$1")
snakemake=$2
work=$(mktemp -d "${TMPDIR:-/tmp}/ivv-cluster.XXXXXX")
daemons=()
end() {
    if [ ${#daemons[@]} -gt 0 ]; then
        kill "${daemons[@]}" 2>/dev/null || true
        wait "${daemons[@]}" 2>/dev/null || true
    fi
    if mountpoint -q "$work/disk" 2>/dev/null; then umount "$work/disk"; fi
    rm -rf "$work"
}
trap end EXIT
cd "$work"
# The jobs call `ivv`.
mkdir bin && ln -s "$ivv" bin/ivv
export PATH="$work/bin:$PATH"

fail() {
    echo "cluster: FAILED: $*" >&2
    exit 1
}
same() { cmp -s "$1/scene.ply" alone/scene.ply || fail "$1/scene.ply is not the scene that one machine makes"; }

ivv --quiet synth --preset tiny --frames 8 -o capture >/dev/null
plan() { ivv --quiet segments plan capture -o "$1" --frames 5 --overlap 2 --steps "$2" >/dev/null; }
steps=400
plan alone $steps
ivv --quiet segments run alone >/dev/null

# Snakemake, both segments at once. One is killed in its course, as by a machine that is lost; the same command goes on.
plan killed $steps
(cd killed && exec "$snakemake" --cores 2 --quiet all) >snakemake.log 2>&1 &
running=$!
for _ in $(seq 600); do
    if [ -n "$(find killed/segment-0001/checkpoints -name '*.ckpt' 2>/dev/null)" ]; then break; fi
    sleep 0.1
done
victim=$(pgrep -f "ivv train .*segment-0001" | head -n 1) || fail "no job was there to be killed: $(cat snakemake.log)"
kill -9 "$victim"
if wait $running; then fail "Snakemake did not notice a job that was killed"; fi
[ ! -e killed/scene.ply ] || fail "there is a scene without one of its segments"
[ ! -e killed/segment-0001/train.json ] || fail "the segment had ended before it was killed: more than $steps steps are needed"
(cd killed && "$snakemake" --cores 2 --quiet all --rerun-incomplete) >>snakemake.log 2>&1 || fail "$(cat snakemake.log)"
same killed
echo "cluster: Snakemake: a job killed, the same command again, the same scene"

# A disk that is full while the segments are joined: a message, no half a file, and all is well once there is room.
if [ "$(id -u)" -eq 0 ] && mkdir disk && mount -t tmpfs -o size=64m none disk 2>mount.log; then
    mkdir disk/plan
    tar -C alone --exclude=checkpoints --exclude=renders --exclude=./scene.ply -c . | tar -C disk/plan -x
    size=$(stat -c %s alone/scene.ply)
    free=$(df --output=avail -B1 disk | tail -n 1)
    head -c $((free - size / 2)) /dev/zero >disk/ballast
    if ivv segments join disk/plan >join.log 2>&1; then fail "a scene was joined on a full disk"; fi
    grep -q "scene.ply: cannot be written" join.log || fail "a full disk is told as: $(cat join.log)"
    [ -z "$(find disk/plan -maxdepth 1 -name '*scene.ply*')" ] || fail "a full disk left half a scene"
    rm disk/ballast
    ivv --quiet segments join disk/plan >/dev/null
    same disk/plan
    umount disk
    echo "cluster: a full disk: no scene, and the same scene once there is room"
else
    echo "cluster: skipped: a full disk, which needs root and a file system in memory"
fi

# Slurm on one node.
has_slurm=yes
for program in slurmctld slurmd munged sbatch; do
    command -v $program >/dev/null || has_slurm=no
done
if [ $has_slurm = no ] || [ "$(id -u)" -ne 0 ]; then
    echo "cluster: skipped: Slurm, which needs slurmctld, slurmd, munge (tools/setup.sh cluster) and root"
    exit 0
fi
host=$(hostname -s)
mkdir -p slurm/spool slurm/state /run/munge
[ -s /etc/munge/munge.key ] || { head -c 1024 /dev/urandom >/etc/munge/munge.key; }
chown -R munge: /etc/munge /run/munge /var/lib/munge /var/log/munge && chmod 400 /etc/munge/munge.key
pgrep -x munged >/dev/null || runuser -u munge -- munged
cat >slurm/slurm.conf <<EOT
ClusterName=ivv
SlurmctldHost=$host
SlurmUser=root
AuthType=auth/munge
ProctrackType=proctrack/pgid
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
ReturnToService=2
SlurmctldPort=16817
SlurmdPort=16818
StateSaveLocation=$work/slurm/state
SlurmdSpoolDir=$work/slurm/spool
SlurmctldPidFile=$work/slurm/slurmctld.pid
SlurmdPidFile=$work/slurm/slurmd.pid
SlurmctldLogFile=$work/slurm/slurmctld.log
SlurmdLogFile=$work/slurm/slurmd.log
NodeName=$host CPUs=$(nproc) State=UNKNOWN
PartitionName=all Nodes=$host Default=YES MaxTime=INFINITE State=UP
EOT
export SLURM_CONF=$work/slurm/slurm.conf
slurmctld -D >slurm/out 2>&1 &
daemons+=($!)
slurmd -D >>slurm/out 2>&1 &
daemons+=($!)
for _ in $(seq 100); do
    if sinfo -h -o %T 2>/dev/null | grep -q idle; then break; fi
    sleep 0.2
done
plan slurmed $steps
(cd slurmed && bash slurm.sh --output=job-%A-%a.log) >slurm/submitted 2>&1 || fail "$(cat slurm/submitted slurm/out)"
for _ in $(seq 900); do
    if [ -z "$(squeue -h 2>/dev/null)" ]; then break; fi
    sleep 0.2
done
[ -e slurmed/scene.ply ] || fail "Slurm's jobs made no scene: $(squeue; tail -n 5 slurmed/job-*.log slurm/*.log)"
same slurmed
echo "cluster: Slurm: an array of segments, the same scene"
