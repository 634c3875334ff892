#!/usr/bin/env bash
# Rendering through a real Slurm of two nodes: frames with a requeued and a killed task, frames with a node that is lost in
# the middle, tiles of one picture joined behind the array.
# Usage: tests/farm/slurm.sh [OCTRAY]; without OCTRAY the release build of this repository.
set -uo pipefail
here=$(cd "$(dirname "$0")" && pwd)
octray=$(realpath "${1:-$here/../../target/release/octray}")
[ -x "$octray" ] || { echo "$octray is not there: cargo build --release first"; exit 2; }
[ "$(id -u)" = 0 ] || { echo "passed over: needs root for a Slurm of its own"; exit 0; }
for program in slurmctld slurmd sbatch munge unshare; do
  command -v $program >/dev/null || { echo "passed over: $program is not installed (slurmctld slurmd slurm-client munge)"; exit 0; }
done
export SLURM_LAB=${TMPDIR:-/tmp}/octray-lab.$$
work=$SLURM_LAB/work
mkdir -p "$work" && cd "$work"
bash "$here/lab.sh" up || { echo "passed over: Slurm does not start here: $(tail -3 "$SLURM_LAB"/*.log)"; exit 0; }
trap 'bash "$here/lab.sh" down; rm -rf "$SLURM_LAB"' EXIT
source "$here/../survive/scene.sh"
failures=0
fail() { echo "  FAILED: $*"; failures=$((failures + 1)); }

# $1: the last job. Waits for it, for five minutes at the most.
await() {
  for _ in $(seq 1500); do
    [ -z "$(squeue -h -j "$1" 2>/dev/null)" ] && return
    sleep 0.2
  done
  fail "job $1 does not end"; squeue; cat ./*.out 2>/dev/null
}

scene turn 1 320 240
"$octray" render turn.toml --frames 1-60 --out-dir whole --no-date -q

# $1: its output. Submits turn.sh: `array` and `last` are the jobs.
submit() {
  "$octray" farm slurm turn.toml --frames 1-60 --shards 4 --out-dir "$1" -o turn.sh || fail "no script"
  local said
  said=$(sh turn.sh) || fail "not submitted"
  array=$(echo "$said" | sed 's/array \([0-9]*\),.*/\1/') last=$(echo "$said" | sed 's/.*it \([0-9]*\)$/\1/')
}

# $1: a node, or nothing for any. The tasks that run there, for ten seconds at the most until there are any.
running() {
  for _ in $(seq 100); do
    squeue -h -t R -r -j "$array" ${1:+-w "$1"} -o %F_%K | grep . && return
    sleep 0.1
  done
}

# $1: the output. All frames are there, the same bytes, and nothing else.
compare() {
  for file in whole/*.exr; do
    cmp -s "$file" "$1/${file#whole/}" || fail "${file#whole/} is missing or differs"
  done
  [ -z "$(find "$1" -name '.*.tmp')" ] || fail "hidden files are left"
  "$octray" status "$1" || fail "status"
}

echo "frames, with a requeued and a killed task"
submit out
one=$(running lab1 | head -1) other=$(running lab2 | head -1)
sleep 0.5
[ -n "$one" ] && scontrol requeue "$one" && echo "  requeued $one" || fail "nothing to requeue"
[ -n "$other" ] && scancel "$other" && echo "  killed $other" || fail "nothing to kill"
await "$last"
compare out

echo "frames, with a node that is lost in the middle"
submit lost
task=$(running lab2 | head -1)
for _ in $(seq 100); do [ "$(find lost -name '*.exr' 2>/dev/null | wc -l)" -ge 4 ] && break; sleep 0.1; done
bash "$here/lab.sh" lose lab2
echo "  lost lab2 with $task on it, $(find lost -name '*.exr' | wc -l) of 60 frames there"
for _ in $(seq 300); do [ "$(sinfo -h -N -n lab2 -o %t | tr -d '*')" = down ] && break; sleep 0.2; done
[ "$(sinfo -h -N -n lab2 -o %t | tr -d '*')" = down ] || fail "the node does not count as lost: $(sinfo -h -N)"
# Its task goes on on the other node, and so does the rest.
await "$last"
restarts=$(scontrol show job "$task" | sed -n 's/.*Restarts=\([0-9]*\).*/\1/p')
[ "${restarts:-0}" -ge 1 ] && echo "  $task was started again, $(scontrol show job "$task" | sed -n 's/^ *NodeList=//p')" || fail "$task was not started again"
compare lost
bash "$here/lab.sh" join lab2
for _ in $(seq 100); do [ "$(sinfo -h -N -n lab2 -o %t)" = idle ] && break; sleep 0.2; done

echo "tiles of one picture, joined"
"$octray" farm slurm turn.toml --tiles 2x2 --picture one.exr -o one.sh || fail "no script"
last=$(sh one.sh | sed 's/.*it \([0-9]*\)$/\1/')
await "$last"
"$octray" render turn.toml -o whole.exr --no-date -q
cat slurm-*.out 2>/dev/null | tail -5
cmp -s one.exr whole.exr || fail "the tiles are not the picture"
[ ! -e one.parts ] || fail "parts are left"
[ $failures = 0 ] || { echo "$failures checks failed"; exit 1; }
echo "Slurm renders the same"
