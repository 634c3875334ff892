#!/usr/bin/env python3
"""How much of the hot code is 8-wide: disassembles a release binary and, where perf can, weighs it by samples of a run.

  simd_share.py [BINARY] [--run SCENE [--spp N]]      default: target/release/octray, built with its line tables

Every instruction of the tree's functions belongs to the kernel, or the part of the traversal, whose source stands nearest in its
stack of inlined calls (addr2line -i). `8-wide` are packed instructions on ymm registers; `narrower` are packed or scalar f32
instructions on xmm registers; `f64` decides lanes again that f32 cannot tell; the rest is integers, branches, memory. The last
column is the share of f32 work that is 8-wide. Prints a Markdown table; ends with 1 if the sphere or polygon kernels or the traversal
fall below --least (0.85).
"""
import argparse, collections, os, re, shutil, subprocess, sys, tempfile

HERE = os.path.dirname(os.path.abspath(__file__))
ap = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
ap.add_argument('binary', nargs='?', default=os.path.join(HERE, '../target/release/octray'))
ap.add_argument('--run', help='a scene to render under perf record')
ap.add_argument('--spp', type=int, default=64)
ap.add_argument('--least', type=float, default=0.85)
A = ap.parse_args()

FUNCTION = re.compile(r'octray::(accel|shapes|integrate|shade|lanes|tracer)::|octray\.\.(accel|shapes)|as octray::shapes')
INSTRUCTION = re.compile(r'^\s*([0-9a-f]+):\s+([a-z][a-z0-9.]*)\s*(.*)$')
FLOAT = re.compile(r'(ps|pd|ss|sd)$|^v?(perm|blend|broadcast|shuf|unpck)')

def kind(mnemonic, operands):
    if mnemonic.endswith(('sd', 'pd')): return 'double'
    if '%ymm' in operands or '%zmm' in operands: return 'wide'
    if '%xmm' in operands and FLOAT.search(mnemonic): return 'narrow'
    return 'other'

def disassemble():
    """Instructions of the functions that matter: (address, kind), and the functions' names."""
    out = subprocess.run(['objdump', '-d', '-C', '--no-show-raw-insn', A.binary], capture_output=True, text=True, check=True).stdout
    found, inside = [], False
    for line in out.splitlines():
        if line.endswith('>:'): inside = bool(FUNCTION.search(line)); continue
        m = inside and INSTRUCTION.match(line)
        if m: found.append((int(m[1], 16), kind(m[2], m[3])))
    return found

def parts(addresses):
    """The part that each address belongs to."""
    asked = '\n'.join(f'0x{a:x}' for a in addresses)
    out = subprocess.run(['addr2line', '-a', '-i', '-e', A.binary], input=asked, capture_output=True, text=True, check=True).stdout
    stacks, stack = [], None
    for line in out.splitlines():
        if line.startswith('0x'): stack = []; stacks.append(stack)
        else: stack.append(line)
    return [part(stack) for stack in stacks]

def part(stack):
    for place in stack:                                      # innermost first
        m = re.search(r'src/(shapes|accel|integrate|shade)/([a-z_0-9]+)\.rs', place)
        if not m: continue
        folder, name = m.groups()
        if folder == 'shapes' and name not in ('mod', 'store', 'stores'): return name + ' kernel'
        if folder == 'accel' and name != 'build': return 'leaf' if name == 'leaf' else 'traversal'
        if folder in ('integrate', 'shade'): return 'shading'
    return None

def samples():
    """Samples by static address, from perf: symbols and offsets, since the program is loaded somewhere else each time."""
    if not A.run: return None
    if not shutil.which('perf'): print('perf is not there: no samples', file=sys.stderr); return None
    with tempfile.TemporaryDirectory() as room:
        data = room + '/perf.data'
        run = [A.binary, 'render', A.run, '-o', room + '/x.exr', '-q', '-t', '1', '--spp', str(A.spp)]
        if subprocess.run(['perf', 'record', '-q', '-e', 'cpu-clock', '-F', '4000', '-o', data, '--', *run], capture_output=True).returncode:
            print('perf may not record here: no samples', file=sys.stderr); return None
        out = subprocess.run(['perf', 'script', '-i', data, '-F', 'ip,sym,symoff', '--no-demangle'], capture_output=True, text=True).stdout
    symbols = {}
    for line in subprocess.run(['nm', A.binary], capture_output=True, text=True).stdout.splitlines():
        at, _, name = (line.split() + [''] * 3)[:3]
        if name: symbols[name] = int(at, 16)
    count, lost = collections.Counter(), 0
    for line in out.splitlines():
        m = re.match(r'\s*[0-9a-f]+ (\S+)\+0x([0-9a-f]+)', line)
        if m and m[1] in symbols: count[symbols[m[1]] + int(m[2], 16)] += 1
        elif line.strip(): lost += 1
    print(f'{sum(count.values())} samples in the binary, {lost} elsewhere (kernel, libraries)', file=sys.stderr)
    return count

found = disassemble()
if not found: sys.exit(f'{A.binary}: no functions of the tree found; was it stripped?')
owner = parts([a for a, _ in found])
if not any(owner): sys.exit(f'{A.binary}: no line tables: build with debug = "line-tables-only" (the default of this folder)')
weights = samples()
table = collections.defaultdict(collections.Counter); timed = collections.defaultdict(collections.Counter)
for (address, what), name in zip(found, owner):
    if not name: continue
    table[name][what] += 1
    if weights: timed[name][what] += weights[address]

def share(c): return c['wide'] / max(1, c['wide'] + c['narrow'])
print('| part | instructions | 8-wide | narrower | f64 | other | 8-wide of f32 |' + (' samples | 8-wide of f32, by samples |' if weights else ''))
print('|---|---|---|---|---|---|---|' + ('---|---|' if weights else ''))
for name, c in sorted(table.items(), key=lambda x: (-sum(timed[x[0]].values()), -sum(x[1].values()))):
    n = sum(c.values()); p = lambda k: f'{100 * c[k] / n:.0f} %'
    row = f'| {name} | {n} | {p("wide")} | {p("narrow")} | {p("double")} | {p("other")} | **{100 * share(c):.1f} %** |'
    if weights: row += f' {sum(timed[name].values())} | {100 * share(timed[name]):.1f} % |'
    print(row)
low = [f'{name} {share(table[name]):.3f}' for name in ('sphere kernel', 'polygon kernel', 'traversal') if share(table[name]) < A.least]
if low: sys.exit('below %g of f32 work 8-wide: %s' % (A.least, ', '.join(low)))
