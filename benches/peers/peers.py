#!/usr/bin/env python3
"""octray beside Embree, POV-Ray, Tachyon and Mitsuba 3: Markdown tables on standard output.

  peers.py [rays] [trees] [frames] [nff] [errors]      default: all but the errors
           [--octray BINARY] [--scenes fig5,flake,...] [--reps N] [--dir WORKDIR] [--scenes-nff FOLDER]

rays    million rays per CPU second, one thread, on the very rays that embree_bench dumps: the best of Embree 3 and 4 in any
        packet width and flag against `octray query`. Hit counts are printed beside each other.
trees   seconds to build a tree with 2 threads, and what it holds, beside Embree at its highest quality.
frames  the same picture by every renderer, 2 threads: seconds of tracing as each of them reports it, and of the whole process.
nff     procedural scenes (NFF) by Tachyon and octray, 512 x 512, mirrors and glass to depth 5.
errors  an area light, direct and with paths: seconds against relative MSE to each renderer's own converged picture, octray (as many
        samples for all, and to noise levels) and Mitsuba.

What is not installed is left out, and the table says so. setup.sh installs it and makes the scenes. Everything of one table
row is measured in turns in one run; the best of the repetitions counts, for every renderer alike.
"""
import argparse, csv, glob, io, json, os, platform, subprocess, sys, time
import numpy as np

HERE = os.path.dirname(os.path.abspath(__file__))
os.environ['PYTHONDONTWRITEBYTECODE'] = '1'
ap = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
ap.add_argument('stages', nargs='*', default=[])
ap.add_argument('--octray', default=os.path.join(HERE, '../../target/release/octray'))
ap.add_argument('--scenes', default='fig5,flake,million,discs,polys,mixed')
ap.add_argument('--reps', type=int, default=5)
ap.add_argument('--dir', default=os.environ.get('PEERS_DIR', os.path.join(os.environ.get('TMPDIR', '/tmp'), 'octray-peers')))
ap.add_argument('--scenes-nff', default=os.path.join(HERE, '../../scenes/nff'))
A = ap.parse_args()
W = os.path.abspath(A.dir); RES = W + '/results'; os.makedirs(RES, exist_ok=True)
PY = W + '/venv/bin/python'; OCTRAY = os.path.abspath(A.octray); SCENES = A.scenes.split(',')
LLVM = sorted(glob.glob('/usr/lib/*/libLLVM.so.1[7-9]*') + glob.glob('/usr/lib/*/libLLVM.so.2*'))
if LLVM: os.environ.setdefault('DRJIT_LIBLLVM_PATH', LLVM[0])

def say(*words): print(*words, file=sys.stderr, flush=True)
def scene(name, file=''): return f'{W}/scenes/{name}' + (f'/{file}' if file else '')
def has(program):
    return any(os.access(os.path.join(d, program), os.X_OK) for d in os.environ['PATH'].split(':'))

def once(cmd):
    """Runs a command: wall seconds, CPU seconds, its output; None where it failed."""
    log = open(RES + '/last.log', 'w+'); t = time.time()
    p = subprocess.Popen(cmd, stdout=log, stderr=subprocess.STDOUT, cwd=W)
    _, status, used = os.wait4(p.pid, 0); p.returncode = 0
    wall = time.time() - t; log.seek(0); text = log.read()
    if status: say('failed:', ' '.join(cmd), text[-400:]); return None
    return wall, used.ru_utime + used.ru_stime, text

def first_line(cmd):
    try: out = subprocess.run(cmd, capture_output=True, text=True); return (out.stdout + out.stderr).strip().splitlines()
    except OSError: return []

def tachyon_version():
    return next((l.split('Version')[1].split()[0] for l in first_line(['tachyon', '/nonexistent']) if 'Version' in l), '?')

def versions():
    v = {'octray': (first_line([OCTRAY, '--version']) or ['missing'])[0]}
    if has('povray'): v['POV-Ray'] = next((w for l in first_line(['povray', '--version']) for w in l.split() if w[:2] == '3.'), '?')
    if has('tachyon'): v['Tachyon'] = tachyon_version()
    mi = first_line([PY, '-c', 'import mitsuba; print(mitsuba.__version__)'])
    if mi and mi[0][:1].isdigit(): v['Mitsuba'] = mi[0]
    return v

def machine():
    cpu = next((l.split(':')[1].strip() for l in open('/proc/cpuinfo') if l.startswith('model name')), platform.processor())
    return f'{cpu}, {os.cpu_count()} hardware threads, {platform.system()} {platform.release()}'

def head(title, *more):
    v = ', '.join(f'{k} {x}' if k != 'octray' else x for k, x in versions().items())
    print(f'\n### {title}\n\n{machine()}; {v}; {time.strftime("%F")}, load {os.getloadavg()[0]:.1f} at the start.', *more, '\n')

# ---------------------------------------------------------------- rays
def libraries():
    four = glob.glob(W + '/venv/lib/python3*/site-packages/embreex.libs/libembree4*')
    return ['libembree3.so.3', *four[:1]] if os.access(W + '/embree_bench', os.X_OK) else []

def dump_to_npy(name):
    """The dump of embree_bench: for camera, shadow, bounce a count, seven columns of f32, the pixels."""
    raw = open(f'{RES}/{name}.dump', 'rb').read(); at = 0
    for kind in ('camera', 'shadow', 'bounce'):
        n = int(np.frombuffer(raw, '<u8', 1, at)[0]); at += 8
        c = [np.frombuffer(raw, '<f4', n, at + 4 * n * i) for i in range(7)]; at += 32 * n
        rays = np.zeros((n, 8), '<f4'); rays[:, :3] = np.stack(c[:3], 1); rays[:, 4:7] = np.stack(c[3:6], 1); rays[:, 7] = c[6]
        np.save(f'{RES}/{name}_{kind}.npy', rays)

def embree(name):
    """The best rate by kind of rays, in which mode, and the hit counts."""
    best, hits = {}, {}
    for i, lib in enumerate(libraries()):
        for prim in (['quad', 'tri'] if i == 0 and name in ('polys', 'mixed') else ['quad']):
            cmd = [W + '/embree_bench', lib, scene(name), '--threads', '1', '--quality', 'H', '--reps', str(A.reps), '--prim', prim]
            if i == 0 and prim == 'quad': cmd += ['--dump', f'{RES}/{name}.dump']
            done = once(cmd)
            for row in csv.reader(io.StringIO(done[2] if done else '')):
                if not row or row[0] != 'trace': continue
                kind, rate = row[5], float(row[9])
                hits.setdefault(kind, set()).add(int(row[10]))
                if rate > best.get(kind, (0, ''))[0]: best[kind] = (rate, f'{row[2]} {row[6]}')
    return best, hits

def query(name, rays, any_hit):
    out, stats, file = RES + '/hits.npy', RES + '/stats.json', f'{RES}/{name}_{rays}.npy'
    # Small sets many times over, as embree_bench does.
    repeat = max(A.reps, 5, 2_000_000 // max(1, len(np.load(file, mmap_mode='r'))))
    cmd = [OCTRAY, 'query', scene(name, 'scene.toml'), file, '-o', out, '-t', '1', '--repeat', str(repeat), '--stats', stats, '-q']
    if not once(cmd + (['--any'] if any_hit else [])): return None
    q = json.load(open(stats))['query']
    return q['rays'] / q['trace_cpu_seconds'] / 1e6, q['hits']

def rays():
    if not libraries(): print('\nEmbree is not installed: no table of rays.'); return
    head('Rays: million per CPU second, one thread', 'octray: `octray query`, median of the repetitions; Embree 3 and 4: the best packet width, flag and repetition.')
    print('| scene | rays | octray | Embree | its mode | ratio | hits octray / Embree |\n|---|---|---|---|---|---|---|')
    for name in SCENES:
        say('rays', name); best, hits = embree(name); dump_to_npy(name)
        for label, key, file, any_hit in (('camera, closest', 'primary', 'camera', False), ('shadow, any', 'shadow', 'shadow', True),
                                          ('bounce, closest', 'bounceI', 'bounce', False), ('bounce, any', 'bounceO', 'bounce', True)):
            got = query(name, file, any_hit)
            if got and key in best:
                rate, mode = best[key]
                print(f'| {name} | {label} | {got[0]:.1f} | {rate:.1f} | {mode} | **{got[0] / rate:.2f}** | {got[1]} / {", ".join(map(str, sorted(hits[key])))} |', flush=True)
        os.remove(f'{RES}/{name}.dump')

def octray_stats(path, spp, res, *more):
    stats = RES + '/stats.json'
    done = once([OCTRAY, 'render', path, '-o', RES + '/octray.exr', '--spp', str(spp), '--resolution', '%dx%d' % res, '-t', '2', '--stats', stats, '-q', *more])
    return done and (json.load(open(stats)), done[0])

def trees():
    if not libraries(): print('\nEmbree is not installed: no table of trees.'); return
    head('Trees, 2 threads: seconds to build (megabytes of tree and columns, or geometry)', 'Embree at its highest quality.')
    print('| scene | octray | Embree 3 | Embree 4 | times as long as the best |\n|---|---|---|---|---|')
    for name in SCENES:
        say('tree', name)
        runs = [r for r in (octray_stats(scene(name, 'scene.toml'), 1, (16, 16)) for _ in range(max(3, A.reps))) if r]
        memory = runs[0][0]['memory']
        ours = (min(stats['seconds']['build'] for stats, _ in runs), (memory['column_bytes'] + memory['tree_bytes']) / 1e6)
        theirs = []
        for lib in libraries():
            done = once([W + '/embree_bench', lib, scene(name), '--threads', '2', '--quality', 'H', '--modes', '1', '--reps', '3'])
            row = next((l.split(',') for l in (done[2] if done else '').splitlines() if l.startswith('build,')), None)
            megabytes = lambda field: float(field.split()[-2])
            if row: theirs.append((float(row[5].split()[0]), megabytes(row[6]) + megabytes(row[8])))
        cell = lambda t: f'{t[0]:.4f} ({t[1]:.1f})'
        cells = [cell(t) for t in theirs] + ['-'] * (2 - len(theirs))
        fastest = min((t[0] for t in theirs), default=0)
        print(f'| {name} | {cell(ours)} | {" | ".join(cells)} | {f"**{ours[0] / fastest:.1f}**" if fastest else "-"} |', flush=True)

# ---------------------------------------------------------------- frames
def size(name): return (640, 480) if name == 'fig5' else (1024, 1024)
def reported(text, mark):
    return next((float(l.split(mark)[1].split()[0]) for l in text.splitlines() if mark in l), None)

def octray_frame(*words):
    done = octray_stats(*words)
    return done and (done[0]['seconds']['trace'], done[1])

def povray_frame(name, spp):
    if not has('povray'): return None
    w, h = size(name); side = round(spp ** .5)
    aa = ['-A'] if spp == 1 else ['+A0.0', '+AM1', f'+R{side}', '+J1.0']
    done = once(['povray', '+Iscene.pov', '+L' + scene(name), f'+W{w}', f'+H{h}', '+FE', f'+O{RES}/pov.exr', '-D', '+WT2', *aa])
    trace = done and next((float(l.split('(')[1].split()[0]) for l in done[2].splitlines() if 'Trace Time' in l and '(' in l), None)
    return done and (trace, done[0])

def tachyon_frame(path, spp, *more):
    if not has('tachyon'): return None
    done = once(['tachyon', path, '-numthreads', '2', '-aasamples', str(spp - 1), '-format', 'PPM48', '-o', RES + '/tac.ppm', *more])
    return done and (reported(done[2], 'Ray Tracing Time:'), done[0])

def mitsuba_frame(name, spp):
    """The LLVM variant, warm: rendered again after its kernels are compiled."""
    if 'Mitsuba' not in versions() or name in ('million', 'discs'): return None
    done = once([PY, HERE + '/mi_render.py', scene(name), 'llvm_ad_rgb', str(spp), RES + '/mi.exr', '--reps', '2'])
    return done and (reported(done[2], 'render_warm '), done[0])

def best(run):
    runs = [r for r in (run() for _ in range(max(1, min(A.reps, 3)))) if r and r[0]]
    return (min(r[0] for r in runs), min(r[1] for r in runs)) if runs else None

def frames():
    head('Whole pictures, 2 threads: seconds of tracing as reported (of the whole process)', 'Mitsuba: LLVM variant, warm; its process renders three times.')
    print('| scene | spp | octray | POV-Ray | Tachyon | Mitsuba | octray to the best |\n|---|---|---|---|---|---|---|')
    for spp in (1, 16):
        for name in SCENES:
            say('frame', name, spp)
            ours = best(lambda: octray_frame(scene(name, 'scene.toml'), spp, size(name)))
            theirs = [best(lambda: povray_frame(name, spp)), best(lambda: tachyon_frame(scene(name, 'scene.dat'), spp)), best(lambda: mitsuba_frame(name, spp))]
            known = [t[0] for t in theirs if t]
            cell = lambda t: f'{t[0]:.3f} ({t[1]:.2f})' if t else '-'
            ratio = f'**1/{min(known) / ours[0]:.1f}**' if ours and known else '-'
            print(f'| {name} | {spp} | {cell(ours)} | {" | ".join(map(cell, theirs))} | {ratio} |', flush=True)

def nff():
    if not has('tachyon'): print('\nTachyon is not installed: no table of NFF scenes.'); return
    head('Procedural scenes, 512 x 512, 1 spp, depth 5, 2 threads: seconds of tracing (of the whole process)')
    print('| scene | octray | Tachyon | octray to Tachyon |\n|---|---|---|---|')
    for name in ('balls_s4', 'rings_s7', 'tree_s11', 'lattice_s12', 'shells_s5', 'teapot_s12', 'mount_s6'):
        path = next((p for p in (f'{A.scenes_nff}/{name}.nff', f'{A.scenes_nff}/{name}.nff.gz') if os.path.exists(p)), None)
        if not path: print(f'| {name} | not there |'); continue
        say('nff', name); plain = f'{RES}/{name}.nff'
        with open(plain, 'wb') as f: f.write(subprocess.run(['gzip', '-cdf', path], capture_output=True).stdout)
        ours = best(lambda: octray_frame(plain, 1, (512, 512), '--max-depth', '5'))
        theirs = best(lambda: tachyon_frame(plain, 1, '-res', '512', '512'))
        if ours and theirs:
            print(f'| {name} | {ours[0]:.4f} ({ours[1]:.2f}) | {theirs[0]:.3f} ({theirs[1]:.2f}) | **1/{theirs[0] / ours[0]:.1f}** |', flush=True)

# ---------------------------------------------------------------- errors
def rel_mse(a, b):
    code = ('import sys; sys.path.insert(0, %r); import img; print(img.relmse(img.read(%r), img.read(%r)))' % (HERE, a, b))
    out = subprocess.run([PY, '-c', code], capture_output=True, text=True)
    return float(out.stdout) if out.stdout.strip() else None

# What is compared at equal error: scene, its file, words for octray, words for Mitsuba. A path of octray's depth 3 has Mitsuba's 4.
CASES = [('flake, direct light', 'flake', [], []),
         ('polys, direct light', 'polys', [], []),
         ('flake, paths', 'flake', ['--integrator', 'path', '--max-depth', '3'], ['--integrator', 'path', '--depth', '4'])]
CONVERGED = 4096

def errors():
    head('Area light, 256 x 256, 2 threads: seconds against relative MSE',
         f'Each to its own converged picture ({CONVERGED:,} spp), all with a box filter. Seconds of tracing, best of three; Mitsuba warm.')
    print('| case | renderer | spp or noise level | seconds | relative MSE |\n|---|---|---|---|---|')
    for label, name, own, their in [case for case in CASES if case[1] in SCENES]:
        text = open(scene(name, 'scene_area.toml')).read().replace('[image]\n', '[image]\nfilter = "box"\nfilter_radius = 0.5\n', 1)
        boxed = scene(name, 'scene_area_box.toml'); open(boxed, 'w').write(text)
        def ours(words, out, seed):
            stats = RES + '/stats.json'
            done = once([OCTRAY, 'render', boxed, '-o', out, '--float', *words, '--resolution', '256x256', '-t', '2', '--seed', str(seed), '--stats', stats, '-q', *own])
            return done and json.load(open(stats))['seconds']['trace']
        def theirs(words, out, seed):
            if 'Mitsuba' not in versions(): return None
            done = once([PY, HERE + '/mi_render.py', scene(name), 'llvm_ad_rgb', words[1], out, '--area', '--res', '256', '--reps', '3', '--seed', str(seed), *their])
            return done and reported(done[2], 'render_warm ')
        reference = {run: f'{RES}/{name}_{run.__name__}_reference.exr' for run in (ours, theirs)}
        for run in reference:
            say('reference', label, run.__name__)
            if not run(['--spp', str(CONVERGED)], reference[run], 99): reference[run] = None
        if all(reference.values()):
            print(f'| {label} | the converged pictures to each other | | | {rel_mse(*reference.values()):.1e} |', flush=True)
        counts = [['--spp', str(4 ** k)] for k in range(6)]
        levels = [['--noise', str(0.2 / 2 ** k)] for k in range(5)]
        curves = [curve(label, who, run, words, reference[run]) for who, run, words in
                  (('octray', ours, counts), ('octray, --noise', ours, levels), ('Mitsuba llvm', theirs, counts)) if reference[run]]
        if len(curves) == 3: print_ratios(label, *curves)

def curve(label, who, run, settings, reference):
    """Times and errors, printed as they come."""
    points = []
    for words in settings:
        out = RES + '/error.exr'; times = [t for t in (run(words, out, 17) for _ in range(3 if who[0] == 'o' else 1)) if t]
        error = times and rel_mse(out, reference)
        if error:
            points.append((min(times), error))
            print(f'| {label} | {who} | {words[1]} | {min(times):.4f} | {error:.3e} |', flush=True)
    return points

def print_ratios(label, uniform, noise, theirs):
    """Times at equal error, where the curves overlap: straight lines between points of logarithms."""
    def at(points, error):
        points = sorted((e, t) for t, e in points); e, t = np.log(np.array(points)).T
        return np.exp(np.interp(np.log(error), e, t)) if e[0] <= np.log(error) <= e[-1] else None
    for error in (1e-1, 3e-2, 1e-2, 3e-3, 1e-3, 3e-4):
        own = [t for t in (at(uniform, error), at(noise, error)) if t]; other = at(theirs, error)
        if own and other:
            print(f'| {label} | **at {error:.0e}** | octray {min(own):.4f} s, Mitsuba {other:.4f} s | **1/{other / min(own):.1f}** | |', flush=True)

STAGES = dict(rays=rays, trees=trees, frames=frames, nff=nff, errors=errors)
CHOSEN = A.stages or [stage for stage in STAGES if stage != 'errors']
for stage in CHOSEN:
    if stage not in STAGES: sys.exit(f'{stage} is none of {", ".join(STAGES)}')
if not os.access(OCTRAY, os.X_OK): sys.exit(f'{OCTRAY} is not there: cargo build --release, or say --octray BINARY')
for stage in CHOSEN: STAGES[stage]()
