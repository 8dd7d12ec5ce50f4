#!/usr/bin/env bash
# Written by `ivv segments plan`. Options of sbatch, such as --partition and --gpus=1, are passed on:
#   cd PLAN && bash slurm.sh --gpus=1
# A job that failed is done again by a second call: what is there is not done again.
set -euo pipefail
base=$(sbatch --parsable "$@" --job-name=ivv-base --wrap='ivv segments run . --only base')
segments=$(sbatch --parsable "$@" --job-name=ivv-segment --dependency="afterok:$base" --array=0-@LAST@ \
    --wrap='ivv segments run . --only "$SLURM_ARRAY_TASK_ID"')
sbatch "$@" --job-name=ivv-join --dependency="afterok:$segments" --wrap='ivv segments join .'
