#!/bin/bash
# A job for Slurm that goes on in further jobs until it is done:    sbatch input/slurm.sh JOB.toml RESULT.h5
# RESULT.h5 is where the job's [output] file is. Five minutes before its time is up Slurm sends SIGUSR1; mpirun passes it on, the run
# ends after the point it is at, leaves RESULT.h5.partial (exit code 1), and the job puts itself into the queue again. Whatever
# else ends it, the same command goes on from there.
#SBATCH --job-name=attrito
#SBATCH --nodes=1
#SBATCH --ntasks=8
#SBATCH --cpus-per-task=1
#SBATCH --mem-per-cpu=2G
#SBATCH --time=04:00:00
#SBATCH --signal=B:USR1@300
#SBATCH --output=%x-%j.log
set -u
job=${1:?the job file} result=${2:?the result file of the job}

# attrito and its mpirun on the PATH: modules, or `source script/environment` of where attrito was built.
command -v attrito > /dev/null || { echo "no attrito on the PATH: load its modules here"; exit 2; }
export OPENBLAS_NUM_THREADS=1

asked=
mpirun -n "$SLURM_NTASKS" attrito run --resume "$job" &
run=$!
trap 'asked=yes; kill -USR1 $run' USR1
wait $run; code=$?
# A signal ends `wait`, not the run.
while kill -0 $run 2> /dev/null; do wait $run; code=$?; done

if [ -n "$asked" ] && [ $code -eq 1 ] && [ -e "$result.partial" ]; then
  sbatch "$0" "$job" "$result"
fi
exit $code
