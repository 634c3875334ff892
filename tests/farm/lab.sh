#!/bin/bash
# A Slurm of two nodes on loopback, from the packages of Debian, as root. SLURM_LAB is its directory.
#   lab.sh up | down           starts and stops it; `up` refuses to touch a configuration that it did not write
#   lab.sh lose NODE           ends all processes of a node at once, as where the power goes: lab1 or lab2
#   lab.sh join NODE           starts it again
# A requeued task waits for as long as its credential lasts: seconds here, two minutes where nothing is said.
# A node is a slurmd in a process namespace of its own, whose processes end with it.
set -e
host=$(hostname -s)
lab=${SLURM_LAB:?the directory of the lab}
conf=/etc/slurm/slurm.conf
nodes="lab1 lab2"
join() {
  setsid unshare --pid --mount --mount-proc --fork slurmd -D -N "$1" >"$lab/$1.out" 2>&1 &
  echo $! >"$lab/$1.pid"
}
lose() { # the first process of a namespace takes all others with it
  pkill -KILL -P "$(cat "$lab/$1.pid")" || true
}
case $1 in
up)
  if [ -e $conf ] && ! grep -q '^ClusterName=octraylab$' $conf; then
    echo "$conf belongs to somebody else"
    exit 1
  fi
  install -d -o munge -g munge -m 755 /run/munge
  install -d -o munge -g munge -m 700 /var/log/munge /var/lib/munge
  munge -n >/dev/null 2>&1 || runuser -u munge -- /usr/sbin/munged
  mkdir -p "$lab/state" /etc/slurm
  cpus=$((($(nproc) + 1) / 2))
  cat >$conf <<C
ClusterName=octraylab
SlurmctldHost=$host(127.0.0.1)
SlurmUser=root
SlurmctldPidFile=$lab/slurmctld.pid
SlurmdPidFile=$lab/%n.slurmd.pid
StateSaveLocation=$lab/state
SlurmdSpoolDir=$lab/spool.%n
SlurmctldLogFile=$lab/slurmctld.log
SlurmdLogFile=$lab/%n.log
CommunicationParameters=NoCtldInAddrAny,NoInAddrAny
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
MpiDefault=none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
SlurmdParameters=config_overrides
ReturnToService=2
KillWait=5
AuthInfo=cred_expire=5
SlurmdTimeout=10
SchedulerParameters=sched_min_interval=100000,sched_interval=2,bf_interval=2,requeue_setup_env_fail
NodeName=lab1 NodeHostname=$host NodeAddr=127.0.0.1 Port=17011 CPUs=$cpus State=UNKNOWN
NodeName=lab2 NodeHostname=$host NodeAddr=127.0.0.1 Port=17012 CPUs=$cpus State=UNKNOWN
PartitionName=main Nodes=lab1,lab2 Default=YES MaxTime=INFINITE State=UP
C
  slurmctld
  for node in $nodes; do
    mkdir -p "$lab/spool.$node"
    join "$node"
  done
  for _ in $(seq 50); do
    [ "$(sinfo -h -N -o %T 2>/dev/null | grep -cx idle)" = 2 ] && exit 0
    sleep 0.2
  done
  sinfo -N
  exit 1
  ;;
lose) lose "$2" ;;
join) join "$2" ;;
down)
  scancel -u root || true
  sleep 1
  for node in $nodes; do
    [ -f "$lab/$node.pid" ] && lose "$node"
  done
  [ -f "$lab/slurmctld.pid" ] && kill "$(cat "$lab/slurmctld.pid")" || true
  rm -f $conf
  ;;
esac
