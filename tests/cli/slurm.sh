#!/usr/bin/env bash
# A Slurm of one node on this machine, for the optional test of the Slurm launcher. Needs root and Debian's packages,
# which `start` installs if they are missing. All its files lie in FOLDER.
#
#   tests/cli/slurm.sh start FOLDER     then: export SLURM_CONF=FOLDER/slurm.conf
#   tests/cli/slurm.sh stop FOLDER
set -euo pipefail
action=$1
folder=$(realpath -m "$2")
export SLURM_CONF=$folder/slurm.conf

start() {
  if ! command -v slurmctld slurmd sbatch munged >/dev/null; then
    apt-get update -qq
    DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends slurmctld slurmd slurm-client munge
  fi
  mkdir -p "$folder"/{state,spool,log,munge}
  chmod 755 "$folder" "$folder/munge"
  host=$(hostname -s)
  getent hosts "$host" >/dev/null || echo "127.0.0.1 $host" >> /etc/hosts
  [ -s "$folder/munge/munge.key" ] || (umask 077 && dd if=/dev/urandom of="$folder/munge/munge.key" bs=64 count=16 2>/dev/null)
  cat > "$SLURM_CONF" <<CONF
ClusterName=here
SlurmctldHost=$host(127.0.0.1)
SlurmUser=root
AuthType=auth/munge
AuthInfo=socket=$folder/munge/munge.socket
CryptoType=crypto/munge
SlurmctldPort=16817
SlurmdPort=16818
StateSaveLocation=$folder/state
SlurmdSpoolDir=$folder/spool
SlurmctldPidFile=$folder/slurmctld.pid
SlurmdPidFile=$folder/slurmd.pid
SlurmctldLogFile=$folder/log/slurmctld.log
SlurmdLogFile=$folder/log/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
MpiDefault=none
ReturnToService=2
SchedulerParameters=sched_interval=1
NodeName=$host NodeAddr=127.0.0.1 CPUs=$(nproc) State=UNKNOWN
PartitionName=all Nodes=$host Default=YES MaxTime=INFINITE State=UP
CONF
  munged --force --key-file="$folder/munge/munge.key" --socket="$folder/munge/munge.socket" \
    --pid-file="$folder/munge/munged.pid" --log-file="$folder/log/munged.log" --seed-file="$folder/munge/seed"
  slurmctld
  slurmd
  for _ in $(seq 60); do
    [ "$(sinfo --noheader --format=%t 2>/dev/null)" = idle ] && echo "Slurm is ready: export SLURM_CONF=$SLURM_CONF" && return
    sleep 0.5
  done
  echo "Slurm did not come up; see $folder/log" >&2
  exit 1
}

stop() {
  for name in slurmd.pid slurmctld.pid munge/munged.pid; do
    [ -s "$folder/$name" ] && kill "$(cat "$folder/$name")" 2>/dev/null || true
  done
}

case $action in
  start | stop) $action ;;
  *) echo "start or stop, got $action" >&2; exit 2 ;;
esac
