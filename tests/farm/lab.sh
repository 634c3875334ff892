#!/bin/bash
# A Slurm of one node on loopback, from the packages of Debian: lab.sh up|down, as root. SLURM_LAB is its directory.
# `up` refuses to touch a configuration that it did not write.
set -e
host=$(hostname -s)
lab=${SLURM_LAB:?the directory of the lab}
conf=/etc/slurm/slurm.conf
case $1 in
up)
  if [ -e $conf ] && ! grep -q '^ClusterName=octraylab$' $conf; then
    echo "$conf belongs to somebody else"
    exit 1
  fi
  install -d -o munge -g munge -m 755 /run/munge
  install -d -o munge -g munge -m 700 /var/log/munge /var/lib/munge
  munge -n >/dev/null 2>&1 || runuser -u munge -- /usr/sbin/munged
  mkdir -p "$lab/state" "$lab/spool" /etc/slurm
  cat >$conf <<C
ClusterName=octraylab
SlurmctldHost=$host(127.0.0.1)
SlurmUser=root
SlurmctldPidFile=$lab/slurmctld.pid
SlurmdPidFile=$lab/slurmd.pid
StateSaveLocation=$lab/state
SlurmdSpoolDir=$lab/spool
SlurmctldLogFile=$lab/slurmctld.log
SlurmdLogFile=$lab/slurmd.log
CommunicationParameters=NoCtldInAddrAny,NoInAddrAny
ProctrackType=proctrack/linuxproc
TaskPlugin=task/affinity
MpiDefault=none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
ReturnToService=2
KillWait=5
SchedulerParameters=sched_min_interval=100000,requeue_setup_env_fail
NodeName=$host NodeAddr=127.0.0.1 CPUs=$(nproc) State=UNKNOWN
PartitionName=main Nodes=$host Default=YES MaxTime=INFINITE State=UP
C
  slurmctld
  slurmd
  for _ in $(seq 50); do
    sinfo -h -o %T 2>/dev/null | grep -qx idle && exit 0
    sleep 0.2
  done
  sinfo
  exit 1
  ;;
down)
  scancel -u root || true
  sleep 1
  for daemon in slurmd slurmctld; do
    [ -f "$lab/$daemon.pid" ] && kill "$(cat "$lab/$daemon.pid")" || true
  done
  rm -f $conf
  ;;
esac
