#!/usr/bin/env bash
# What a batch must survive, done for real: kills, a full disk, two processes at once, signals, broken scenes.
# Usage: tests/survive/run.sh [OCTRAY [CASE...]]; without OCTRAY the release build of this repository.
# Cases that need root say so and are passed over without it.
set -uo pipefail
here=$(cd "$(dirname "$0")" && pwd)
octray=$(realpath "${1:-$here/../../target/release/octray}")
shift || true
[ -x "$octray" ] || { echo "$octray is not there: cargo build --release first"; exit 2; }
work=$(mktemp -d)
mounted=
cleanup() { [ -z "$mounted" ] || umount "$mounted"; rm -rf "$work"; }
trap cleanup EXIT
cd "$work"
failures=0
fail() { echo "  FAILED: $*"; failures=$((failures + 1)); }
expect() { [ "$1" = "$2" ] || fail "$3: found $1, not $2"; }
source "$here/scene.sh"
names() { find "$1" -type f -name "$2" | sed 's|.*/||' | sort; }
sums() { (cd "$1" && sha256sum ./*.exr); }
millis() { echo $(($(date +%s%N) / 1000000)); }

killed() { # kill -9 at random times, 20 times over one batch, and resume
  scene s 1
  "$octray" render s.toml --frames 1-40 --spp 16 --out-dir whole --no-date -q || fail "the unbroken run"
  local begin took runs=0
  begin=$(millis)
  "$octray" render s.toml --frames 1-40 --spp 16 --out-dir timed --no-date -q
  took=$(($(millis) - begin))
  for _ in $(seq 20); do
    "$octray" render s.toml --frames 1-40 --spp 16 --out-dir out --no-date -q --resume 2>/dev/null &
    local pid=$!
    sleep "$(awk -v most="$took" -v r="$RANDOM" 'BEGIN { printf "%.3f", most / 12000 * r / 32768 }')"
    kill -9 $pid 2>/dev/null && runs=$((runs + 1))
    wait $pid 2>/dev/null
    # Whatever has its name is whole.
    for file in out/*.exr; do
      [ -e "$file" ] || continue
      cmp -s "$file" "whole/${file#out/}" || fail "$file is not what it should be"
    done
  done
  "$octray" render s.toml --frames 1-40 --spp 16 --out-dir out --no-date -q --resume || fail "the last run"
  expect "$(sums out)" "$(sums whole)" "the same bytes"
  expect "$(names out '.*.tmp' | wc -l)" 0 "hidden files left"
  echo "  $runs of 20 runs were killed, of $took ms each"
}

two_processes() { # both write everything, both succeed
  scene s 1
  "$octray" render s.toml --frames 1-20 --out-dir whole --no-date -q
  "$octray" render s.toml --frames 1-20 --out-dir out --no-date -q & local a=$!
  "$octray" render s.toml --frames 1-20 --out-dir out --no-date -q & local b=$!
  wait $a; expect $? 0 "the first one"
  wait $b; expect $? 0 "the second one"
  expect "$(sums out)" "$(sums whole)" "the same bytes"
  expect "$(names out '.*.tmp' | wc -l)" 0 "hidden files left"
}

full_disk() { # a file system of 200 kB
  [ "$(id -u)" = 0 ] || { echo "  passed over: needs root for a small tmpfs"; return; }
  scene s 1
  mkdir small
  mount -t tmpfs -o size=200k none small 2>/dev/null || { echo "  passed over: no tmpfs can be mounted here"; return; }
  mounted=$work/full_disk/small
  "$octray" render s.toml --frames 1-40 --out-dir small --no-date 2>err
  local code=$?
  [ $code = 1 ] || [ $code = 4 ] || fail "exit code $code"
  grep -q "No space left" err || fail "no word about the disk: $(cat err)"
  expect "$(names small '.*.tmp' | wc -l)" 0 "hidden files left"
  "$octray" render s.toml --frames 1-40 --out-dir whole --no-date -q
  local count=0
  for file in small/*.exr; do
    [ -e "$file" ] || continue
    cmp -s "$file" "whole/${file#small/}" || fail "$file is not whole"
    count=$((count + 1))
  done
  [ $count -gt 0 ] || fail "nothing was written at all"
  # Room again: the rest follows.
  mount -o remount,size=50m small
  "$octray" render s.toml --frames 1-40 --out-dir small --no-date -q --resume || fail "resuming with room"
  expect "$(sums small)" "$(sums whole)" "the same bytes"
  umount small; mounted=
}

read_only() { # a directory that cannot be written to ends the batch before it begins
  scene s 1
  mkdir locked
  if [ "$(id -u)" = 0 ]; then
    mount -t tmpfs -o ro none locked 2>/dev/null || { echo "  passed over: no tmpfs can be mounted here"; return; }
    mounted=$work/read_only/locked
  else
    chmod 555 locked
  fi
  "$octray" render s.toml --frames 1-40 --out-dir locked 2>err
  expect $? 4 "exit code"
  grep -q "cannot be written" err || fail "$(cat err)"
  if [ -n "$mounted" ]; then umount locked; mounted=; fi
}

stopped() { # SIGTERM and SIGINT are answered within two seconds, and nothing half is left
  scene s 1
  for signal in TERM INT; do
    # A background process of a script ignores SIGINT unless told otherwise.
    setsid bash -c 'trap - INT; exec "$@"' - "$octray" render s.toml --frames 1-2000 --spp 512 --out-dir "out$signal" --no-date -q 2>err &
    local pid=$! code begin took
    sleep 2
    begin=$(millis)
    kill -$signal $pid
    wait $pid; code=$?
    took=$(($(millis) - begin))
    [ "$signal" = TERM ] && expect $code 143 "exit code" || expect $code 130 "exit code"
    [ $took -lt 2000 ] || fail "it took $took ms"
    expect "$(names "out$signal" '.*.tmp' | wc -l)" 0 "hidden files left"
    grep -q "stopped by SIG$signal" err || fail "$(cat err)"
    echo "  SIG$signal: $took ms"
  done
}

one_broken() { # 99 pictures, exit code 1, the name of the other one
  for i in $(seq -w 100); do scene "s$i" "0.$((10#$i % 90 + 10))"; done
  sed -i 's/radius = .*/radius = -1/' s042.toml
  "$octray" render s*.toml --out-dir out --no-date --spp 1 2>err
  expect $? 1 "exit code"
  expect "$(names out '*.exr' | wc -l)" 99 "pictures"
  tail -1 err | grep -q "1 of 100 pictures failed: out/s042.exr" || fail "$(tail -1 err)"
  grep -q "s042.toml:20:10: sphere radius must be > 0, found -1" err || fail "the mistake is not shown"
}

stale() { # a second run does what is missing, cut or stale, and no more
  printf 'x,y,z,r\n0,0,0,1\n' >balls.csv
  scene s 1
  printf '[[clouds]]\ntype = "spheres"\nfile = "balls.csv"\nmaterial = "clay"\n' >>s.toml
  again() { "$octray" render s.toml --frames 1-10 --out-dir out --no-date --resume "$@" 2>&1 | grep "pictures written"; }
  again >/dev/null
  again | grep -q "0 of 10 pictures written, 10 were there" || fail "all should be there: $(again)"
  rm out/s.0003.exr; truncate -s 0 out/s.0004.exr; truncate -s -100 out/s.0005.exr
  printf 'x' | dd of=out/s.0006.exr bs=1 seek=2000 conv=notrunc 2>/dev/null
  again | grep -q "4 of 10 pictures written, 6 were there" || fail "the four broken ones"
  printf 'x,y,z,r\n0,0,0,1.5\n' >balls.csv
  again | grep -q "10 of 10 pictures written" || fail "a file that the scene names has changed"
  again --spp 3 | grep -q "10 of 10 pictures written" || fail "another setting"
  again --spp 3 | grep -q "0 of 10 pictures written" || fail "all there again"
}

memory() { # a scene that would need more is refused before it is read
  scene s 1
  python3 - <<'P' 2>/dev/null || { echo "  passed over: needs python3"; return; }
with open("big.csv", "w") as f:
    f.write("x,y,z,r\n")
    for i in range(200000):
        f.write(f"{i % 97},{i % 89},{i % 83},0.1\n")
P
  cp s.toml big.toml
  printf '[[clouds]]\ntype = "spheres"\nfile = "big.csv"\nmaterial = "clay"\n' >>big.toml
  "$octray" render big.toml -o big.exr --spp 1 --max-memory 20M 2>err
  expect $? 5 "exit code"
  grep -q "MiB of memory are needed, and the limit is 20 MiB" err || fail "$(cat err)"
  "$octray" render s.toml big.toml --out-dir out --spp 1 --max-memory 20M 2>err
  expect $? 1 "exit code"
  expect "$(names out '*.exr')" s.exr "the small one"
  "$octray" render big.toml -o big.exr --spp 1 --max-memory 1G -q || fail "with room"
}

for case in ${*:-killed two_processes full_disk read_only stopped one_broken stale memory}; do
  echo "$case"
  mkdir "$work/$case" && cd "$work/$case" && $case
  cd "$work"
done
[ $failures = 0 ] || { echo "$failures checks failed"; exit 1; }
echo "all of it was survived"
