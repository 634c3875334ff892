#!/usr/bin/env python3
"""Trajectories: octray and Tachyon render the same frames of the same particles.

    python3 benches/peers/particles.py [--octray target/release/octray] [--sizes 1000,10000,100000,1000000] [--reps 3]
                                        [--ovito PYTHON]

N spheres on a jittered lattice wander; 640x480 pixels, one sample each, one point light with shadows, two threads, a PNG a
frame. octray reads the frames from one XYZ file, all in one process, as `octray render --frames` does; Tachyon takes a scene
file a frame, which were written before the clock starts, in a process each, as it is made for. Both take turns; the median of
the runs counts. The pictures of the first frame are compared before. With --ovito, a Python
that has the package of that name, OVITO renders the first frames too (ovito_frames.py). Standard library only; prints Markdown.
"""
import argparse, json, math, os, random, resource, shutil, subprocess, sys, tempfile, time

WIDTH, HEIGHT, VFOV = 640, 480, 30.0
FRAMES = {1_000: 60, 10_000: 30, 100_000: 8, 1_000_000: 2}
COLORS = [(0.8, 0.3, 0.2), (0.2, 0.5, 0.8), (0.7, 0.7, 0.3)]

def particles(n, seed=5):
    """Places in the unit cube around 0, a radius for all, and a velocity each."""
    dice, side = random.Random(seed), round(n ** (1 / 3)) or 1
    step = 1 / side
    jitter = lambda: (dice.random() - 0.5) * 0.3 * step
    cells = [(i, j, k) for i in range(side + 1) for j in range(side) for k in range(side)][:n]
    places = [tuple((c + 0.5) * step - 0.5 + jitter() for c in cell) for cell in cells]
    moves = [(jitter() * 0.2, jitter() * 0.2, jitter() * 0.2) for _ in cells]
    return places, 0.4 * step, moves

def frame(places, moves, f):
    return [tuple(p + f * m for p, m in zip(place, move)) for place, move in zip(places, moves)]

EYE, LIGHT, POWER = (0.9, 0.7, 2.2), (2.0, 4.0, 3.0), 30.0

def write_octray(folder, places, radius, moves, frames):
    with open(f'{folder}/traj.xyz', 'w') as out:
        for f in range(frames):
            out.write(f'{len(places)}\nProperties=species:S:1:pos:R:3\n')
            out.writelines('%s %.6f %.6f %.6f\n' % ('CNO'[i % 3], *p) for i, p in enumerate(frame(places, moves, f)))
    with open(f'{folder}/scene.toml', 'w') as out:
        out.write(f'''format = 1
[image]
width = {WIDTH}
height = {HEIGHT}
spp = 1
[camera]
type = "pinhole"
eye = {list(EYE)}
target = [0, 0, 0]
vfov = {VFOV}
[materials.white]
type = "diffuse"
albedo = [1, 1, 1]
[[lights]]
type = "point"
position = {list(LIGHT)}
intensity = [{POWER}, {POWER}, {POWER}]
[[clouds]]
type = "particles"
file = "traj.xyz"
material = "white"
style = "spheres"
radius = {radius}
color = [0.8, 0.5, 0.3]
''')

def write_tachyon(path, places, radius):
    """Tachyon's camera is left-handed: x is negated everywhere."""
    n = lambda a: '%.6f %.6f %.6f' % (-a[0], a[1], a[2])
    zoom = 0.5 / math.tan(math.radians(VFOV) / 2)
    with open(path, 'w') as out:
        out.write(f'BEGIN_SCENE\nRESOLUTION {WIDTH} {HEIGHT}\nCAMERA\n ZOOM {zoom:.9g}\n ASPECTRATIO 1.0\n ANTIALIASING 0\n RAYDEPTH 2\n'
                  f' CENTER {n(EYE)}\n VIEWDIR {n([-c for c in EYE])}\n UPDIR 0 1 0\nEND_CAMERA\nBACKGROUND 0 0 0\n')
        out.write(f'LIGHT CENTER {n(LIGHT)} RAD 0.0001 ATTENUATION CONSTANT 0 LINEAR 0 QUADRATIC {math.pi / POWER:.9g} COLOR 1 1 1\n')
        out.write('TEXDEF M AMBIENT 0 DIFFUSE 1 SPECULAR 0 OPACITY 1 COLOR 0.8 0.5 0.3 TEXFUNC 0\n')
        out.writelines(f'SPHERE CENTER {n(p)} RAD {radius:.6f} M\n' for p in places)
        out.write('END_SCENE\n')

def run(*commands):
    """Wall and CPU seconds of commands one after the other, and the most memory of one in MiB."""
    start, before, most = time.time(), resource.getrusage(resource.RUSAGE_CHILDREN), 0
    for command in commands:
        child = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        _, status, used = os.wait4(child.pid, 0)
        child.returncode = status
        if status: sys.exit(f'failed: {command}')
        most = max(most, used.ru_maxrss / 1024)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return time.time() - start, cpu, most

def median(values):
    values = sorted(values)
    return values[len(values) // 2]

def main():
    args = argparse.ArgumentParser()
    args.add_argument('--octray', default='target/release/octray'); args.add_argument('--reps', type=int, default=3)
    args.add_argument('--sizes', default=','.join(map(str, FRAMES)))
    args.add_argument('--ovito', help='a Python that has the package ovito')
    args = args.parse_args()
    if not shutil.which('tachyon'): sys.exit('tachyon is not installed')
    print('| particles | frames | octray, frames/s | Tachyon, frames/s | ratio | CPU s a frame | ratio | MiB | same pixels | OVITO, frames/s |\n|---|---|---|---|---|---|---|---|---|---|')
    for size in map(int, args.sizes.split(',')):
        with tempfile.TemporaryDirectory() as folder:
            frames = FRAMES.get(size, max(2, 300_000 // size))
            places, radius, moves = particles(size)
            radius = float('%.6f' % radius)
            write_octray(folder, places, radius, moves, frames)
            for f in range(frames): write_tachyon(f'{folder}/{f}.dat', frame(places, moves, f), radius)
            ours = [args.octray, 'render', f'{folder}/scene.toml', '--frames', f'1-{frames}', '--name', '{scene}.####.png', '--out-dir', f'{folder}/out', '-t', '2', '--tonemap', 'none', '--no-dither', '-q']
            theirs = [['tachyon', f'{folder}/{f}.dat', '-numthreads', '2', '-format', 'PNG', '-o', f'{folder}/{f}.png'] for f in range(frames)]
            rounds = [(run(ours), run(*theirs), ovito(args.ovito, folder, frames, radius)) for _ in range(args.reps)]
            pairs, others = [turn[:2] for turn in rounds], [turn[2] for turn in rounds if turn[2]]
            (a, b), (p, q) = ([median(pair[k][i] for pair in pairs) for k in (0, 1)] for i in (0, 1))
            ratio, cpu = median(pair[1][0] / pair[0][0] for pair in pairs), median(pair[1][1] / pair[0][1] for pair in pairs)
            other = '%.2f' % (1 / median(others)) if others else '-'
            memory = ' / '.join('%.0f' % max(pair[k][2] for pair in pairs) for k in (0, 1))
            print(f'| {size:,} | {frames} | {frames / a:.1f} | {frames / b:.2f} | {ratio:.1f} | {p / frames:.4f} / {q / frames:.4f} | {cpu:.1f} | {memory} | {same(args.octray, folder)} | {other} |', flush=True)

def ovito(python, folder, frames, radius):
    """Seconds a frame, at most six of them; None without OVITO."""
    if not python: return None
    script = os.path.join(os.path.dirname(os.path.abspath(__file__)), 'ovito_frames.py')
    done = subprocess.run([python, script, f'{folder}/traj.xyz', str(min(frames, 6)), str(radius), f'{folder}/ovito'], capture_output=True, text=True)
    return float(done.stdout.split()[-1]) if done.returncode == 0 else sys.exit(done.stderr)

def same(octray, folder):
    """Share of the pixels of the first frame that are lit in both pictures or dark in both."""
    import struct, zlib
    def dark(path):
        data, at, packed, depth = open(path, 'rb').read(), 8, b'', 3
        while at < len(data):
            length, kind = struct.unpack('>I4s', data[at:at + 8])
            if kind == b'IHDR': depth = {2: 3, 6: 4}[data[at + 17]]
            if kind == b'IDAT': packed += data[at + 8:at + 8 + length]
            at += 12 + length
        raw, row, rows = zlib.decompress(packed), bytearray(WIDTH * depth), []
        for y in range(HEIGHT):
            kind, line = raw[y * (WIDTH * depth + 1)], bytearray(raw[y * (WIDTH * depth + 1) + 1:(y + 1) * (WIDTH * depth + 1)])
            for i in range(len(line)):
                a, b, c = line[i - depth] if i >= depth else 0, row[i], row[i - depth] if i >= depth else 0
                p = a + b - c
                paeth = min((abs(p - a), 0, a), (abs(p - b), 1, b), (abs(p - c), 2, c))[2]
                line[i] = line[i] + (0, a, b, (a + b) // 2, paeth)[kind] & 255
            rows += [max(line[x * depth:x * depth + 3]) < 3 for x in range(WIDTH)]
            row = line
        return rows
    a, b = dark(f'{folder}/out/scene.0001.png'), dark(f'{folder}/0.png')
    return '%.2f %%' % (100 * sum(x == y for x, y in zip(a, b)) / len(a))

if __name__ == '__main__':
    main()
