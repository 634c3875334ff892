#!/usr/bin/env bash
# Rendering through a real Slurm: frames with a requeued and a killed task, tiles of one picture joined behind the array.
# Usage: tests/farm/slurm.sh [OCTRAY]; without OCTRAY the release build of this repository.
set -uo pipefail
here=$(cd "$(dirname "$0")" && pwd)
octray=$(realpath "${1:-$here/../../target/release/octray}")
[ -x "$octray" ] || { echo "$octray is not there: cargo build --release first"; exit 2; }
[ "$(id -u)" = 0 ] || { echo "passed over: needs root for a Slurm of its own"; exit 0; }
for program in slurmctld slurmd sbatch munge; do
  command -v $program >/dev/null || { echo "passed over: $program is not installed (slurmctld slurmd slurm-client munge)"; exit 0; }
done
export SLURM_LAB=${TMPDIR:-/tmp}/octray-lab.$$
work=$SLURM_LAB/work
mkdir -p "$work" && cd "$work"
bash "$here/lab.sh" up || { echo "passed over: Slurm does not start here: $(tail -3 "$SLURM_LAB"/*.log)"; exit 0; }
trap 'bash "$here/lab.sh" down; rm -rf "$SLURM_LAB"' EXIT
failures=0
fail() { echo "  FAILED: $*"; failures=$((failures + 1)); }

# $1: the last job. Waits for it, for five minutes at the most: a requeued task begins after two.
await() {
  for _ in $(seq 1500); do
    [ -z "$(squeue -h -j "$1" 2>/dev/null)" ] && return
    sleep 0.2
  done
  fail "job $1 does not end"; squeue; cat ./*.out 2>/dev/null
}

cat >turn.toml <<T
format = 1
[image]
width = 320
height = 240
spp = 64
[camera]
type = "pinhole"
eye = { keys = [[1, [0, 1, 6]], [100, [3, 2, 5]]] }
target = [0, 0.5, 0]
vfov = 40
[materials.clay]
type = "diffuse"
[[lights]]
type = "point"
position = [3, 5, 4]
intensity = [90, 90, 90]
[[shapes]]
type = "sphere"
center = [0, 1, 0]
radius = 1
material = "clay"
T

echo "frames, with a requeued and a killed task"
"$octray" farm slurm turn.toml --frames 1-60 --shards 4 --out-dir out -o turn.sh || fail "no script"
said=$(sh turn.sh) || fail "not submitted"
array=$(echo "$said" | sed 's/array \([0-9]*\),.*/\1/') last=$(echo "$said" | sed 's/.*it \([0-9]*\)$/\1/')
for _ in $(seq 100); do [ "$(squeue -h -t R -j "$array" | wc -l)" -ge 1 ] && break; sleep 0.1; done
running=($(squeue -h -t R -r -j "$array" -o %F_%K))
sleep 0.5
[ ${#running[@]} -ge 1 ] && scontrol requeue "${running[0]}" && echo "  requeued ${running[0]}"
[ ${#running[@]} -ge 2 ] && scancel "${running[1]}" && echo "  killed ${running[1]}"
await "$last"
"$octray" render turn.toml --frames 1-60 --out-dir whole --no-date -q
for file in whole/*.exr; do
  cmp -s "$file" "out/${file#whole/}" || fail "${file#whole/} is missing or differs"
done
[ -z "$(find out -name '.*.tmp')" ] || fail "hidden files are left"
"$octray" status out || fail "status"

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
