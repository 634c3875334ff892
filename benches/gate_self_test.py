#!/usr/bin/env python3
"""Tries `octray bench gate` itself: a build against its like must pass, and one that takes a tenth more time must fail.

  gate_self_test.py [--octray BINARY] [--runs 20] [--slower 0.1] [--scenes FILE...] [-- more options of the gate]

The like is a copy of the binary. The slower one is a script around it that burns CPU time in proportion to what the render
took, so nothing of this is in the product. Prints each verdict; ends with 1 if one of them is wrong.
"""
import argparse, json, os, shutil, subprocess, sys, tempfile

HERE = os.path.dirname(os.path.abspath(__file__))
ap = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
ap.add_argument('--octray', default=os.path.join(HERE, '../target/release/octray'))
ap.add_argument('--runs', type=int, default=20)
ap.add_argument('--slower', type=float, default=0.1)
ap.add_argument('--scenes', nargs='+', default=[os.path.join(HERE, '../scenes/fig5.toml')])
ap.add_argument('more', nargs='*')
A = ap.parse_args()
OCTRAY = os.path.abspath(A.octray)

SLOWER = '''#!%s -SE
import os, sys
child = os.posix_spawn(%r, [%r] + sys.argv[1:], os.environ)
_, status, used = os.wait4(child, 0)
goal = (used.ru_utime + used.ru_stime) * %r
while sum(os.times()[:2]) < goal and 'render' in sys.argv: pass
sys.exit(os.waitstatus_to_exitcode(status))
'''

def gate(*options):
    out = subprocess.run([OCTRAY, '-q', 'bench', 'gate', *A.scenes, '--json', *options, *A.more], capture_output=True, text=True)
    if out.returncode not in (0, 1): sys.exit(out.stderr)
    for scene in json.loads(out.stdout)['scenes']:
        t = scene['time']
        print('exit %d  %s: %+.1f %% (limit %+.1f %%, noise %.1f %%, %d rounds of %.2f s)' % (
            out.returncode, os.path.basename(scene['scene']), 100 * (t['ratio'] - 1), 100 * (t['limit'] - 1), 100 * t['noise'], t['rounds'], t['seconds']), flush=True)
    return out.returncode

with tempfile.TemporaryDirectory() as room:
    like, slower = room + '/octray', room + '/slower'
    shutil.copy(OCTRAY, like)
    with open(slower, 'w') as f: f.write(SLOWER % (sys.executable, OCTRAY, OCTRAY, A.slower))
    os.chmod(slower, 0o755)
    print(f'{A.runs} runs against its like')
    passed = sum(gate('--against', like) == 0 for _ in range(A.runs))
    print(f'a build that takes {100 * A.slower:g} % more')
    failed = gate('--against', like, '--binary', slower) == 1
    print(f'{passed} of {A.runs} passed; the slower one {"failed, as it must" if failed else "PASSED"}')
    sys.exit(0 if passed == A.runs and failed else 1)
