#!/bin/sh
# Installs the peers that are missing (Debian or Ubuntu, as root) and makes the scenes. Nothing is written next to this script.
#   benches/peers/setup.sh            everything goes to $PEERS_DIR (default: octray-peers in the temporary directory)
# A peer that cannot be installed is left out of the tables, which say so.
set -e
HERE=$(cd "$(dirname "$0")" && pwd); W=${PEERS_DIR:-${TMPDIR:-/tmp}/octray-peers}; mkdir -p "$W"
need() { command -v "$1" >/dev/null 2>&1; }
if ! need povray || ! need tachyon || [ ! -e /usr/include/embree3/rtcore.h ] || ! ls /usr/lib/*/libLLVM.so.19* >/dev/null 2>&1; then
  apt-get install -y -q povray tachyon libembree-dev libllvm19 g++ python3-venv >"$W/apt.log" 2>&1 || echo "see $W/apt.log"
fi
[ -x "$W/venv/bin/python" ] || python3 -m venv "$W/venv"
"$W/venv/bin/python" -c 'import numpy, OpenEXR' 2>/dev/null || "$W/venv/bin/pip" install -q numpy OpenEXR
"$W/venv/bin/python" -c 'import mitsuba' 2>/dev/null || "$W/venv/bin/pip" install -q mitsuba==3.9.1 || true
# Embree 4 comes bundled in this wheel.
ls "$W"/venv/lib/python3*/site-packages/embreex.libs/libembree4* >/dev/null 2>&1 || "$W/venv/bin/pip" install -q embreex || true
if [ -e /usr/include/embree3/rtcore.h ] && { [ ! -e "$W/embree_bench" ] || [ "$HERE/embree_bench.cpp" -nt "$W/embree_bench" ]; }; then
  g++ -O3 -march=native -std=c++17 -o "$W/embree_bench" "$HERE/embree_bench.cpp" -ldl -lpthread
fi
for s in fig5 flake million polys discs mixed; do
  [ -e "$W/scenes/$s/scene.toml" ] && [ "$W/scenes/$s/scene.toml" -nt "$HERE/gen.py" ] && continue
  "$W/venv/bin/python" "$HERE/gen.py" "$W/scenes" "$s" && "$W/venv/bin/python" "$HERE/to_octray.py" "$W/scenes/$s"
done
echo "ready: $W"
