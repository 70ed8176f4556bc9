#!/bin/bash
# An array of 100 workers that share nothing but the run's folder or URL:
#     sbatch examples/fleet/slurm.sh /shared/run
# Submit it again after a failure: what is committed is not done again.
#SBATCH --job-name=siloscope
#SBATCH --array=0-99
#SBATCH --cpus-per-task=1
#SBATCH --mem=1G
#SBATCH --time=12:00:00
#SBATCH --requeue

set -eu
exec siloscope fleet worker "$1" --index "$SLURM_ARRAY_TASK_ID" --of "$SLURM_ARRAY_TASK_COUNT" --json
