#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# batch_slurm.sh BILAYER FOLDER: an array of four shards under Slurm on the loopback interface. One task is killed by
# SIGKILL half-way and requeued. The fields are those of a batch without Slurm.
source "$(dirname "$0")/batch_shared.sh"
need slurmctld slurmd sbatch scontrol squeue munged awk
PATH=$PATH:/usr/sbin
bilayer=$1 work=$2 resolution=112 port=$((20000 + $$ % 20000)) node=$(hostname -s) user=$(id -un) shards=4 count=200
rm -rf "$work" && mkdir -p "$work"/{state,spool,pids} && chmod 755 "$work" && cd "$work"
make_library meshes "$count"

daemons=()
stop() {
  ((${#daemons[@]} == 0)) || kill "${daemons[@]}" 2>/dev/null || true
  wait
}
trap stop EXIT

# The paths of sockets are limited to 108 characters, and a build folder may be deep.
sockets=$(mktemp -d /tmp/bilayer-slurm.XXXXXX)
trap 'stop; rm -rf "$sockets"' EXIT
chmod 755 "$sockets"
head -c 1024 /dev/urandom >munge.key && chmod 400 munge.key
munged --foreground --force --num-threads=2 --key-file="$work/munge.key" --socket="$sockets/munge" \
  --pid-file="$work/munge.pid" --log-file="$work/munge.log" --seed-file="$work/munge.seed" >munged.txt 2>&1 &
daemons+=($!)
wait_for 10 test -S "$sockets/munge" || { echo "skipped: munged does not start here"; cat munged.txt; exit "$skipped"; }

cat >slurm.conf <<TEXT
ClusterName=loopback
SlurmctldHost=$node(127.0.0.1)
SlurmctldPort=$port
SlurmdPort=$((port + 1))
SlurmUser=$user
SlurmdUser=$user
AuthType=auth/munge
# a requeued job waits until its old credentials have expired
AuthInfo=socket=$sockets/munge,cred_expire=5
CredType=cred/munge
StateSaveLocation=$work/state
SlurmdSpoolDir=$work/spool
SlurmctldPidFile=$work/slurmctld.pid
SlurmdPidFile=$work/slurmd.pid
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
SchedulerParameters=batch_sched_delay=0,sched_interval=1
MpiDefault=none
ReturnToService=2
NodeName=$node NodeAddr=127.0.0.1 CPUs=$(nproc) State=UNKNOWN
PartitionName=all Nodes=$node Default=YES State=UP
TEXT
export SLURM_CONF=$work/slurm.conf
slurmctld -D -f slurm.conf >slurmctld.txt 2>&1 &
daemons+=($!)
slurmd -D -f slurm.conf >slurmd.txt 2>&1 &
daemons+=($!)
is_idle() { [[ $(sinfo -h -o %t 2>/dev/null) == idle ]]; }
wait_for 30 is_idle || { echo "skipped: Slurm does not start here"; tail -n 5 slurmctld.txt slurmd.txt; exit "$skipped"; }

cat >shard.sh <<TEXT
#!/bin/sh
echo \$\$ >$work/pids/\$SLURM_ARRAY_TASK_ID
exec $bilayer batch --tree $work/meshes -o $work/fields --threads 1 --resolution $resolution
TEXT
job=$(sbatch --parsable --requeue --cpus-per-task=1 --array=1-$shards --output="$work/task-%a.txt" shard.sh)

# half-way: some meshes of shard 2 have records, others do not
lines() { cat fields/.bilayer/records/*"$1-of-"* 2>/dev/null | wc -l; }
has_begun() { (($(lines 000002) >= 5)); }
wait_for 60 has_begun
kill -KILL "$(cat pids/2)"
state() { scontrol show job "${job}_$1" | sed -n 's/.*JobState=\([A-Z]*\).*/\1/p'; }
is_state() { [[ $(state "$1") == "$2" ]]; }
wait_for 30 is_state 2 FAILED
before=$(lines 000002)
scontrol requeue "${job}_2"
is_over() { [[ -z $(squeue -h) ]]; }
wait_for 120 is_over
for ((task = 1; task <= shards; ++task)); do
  is_state "$task" COMPLETED || { echo "task $task is $(state "$task")"; cat "task-$task.txt"; exit 1; }
done
after=$(lines 000002)
grep -q '"outcome":"skipped"' fields/.bilayer/records/*000002-of-* || { echo "the requeued task skipped nothing"; exit 1; }

unset SLURM_CONF
"$bilayer" batch --tree meshes -o direct --resolution "$resolution" >/dev/null
require_same fields direct
echo "$count meshes by $shards tasks of Slurm; one was killed after $before meshes and went on, to $after records"
