#!/usr/bin/env python3
"""Render a neutral scene with Mitsuba 3.

mi_render.py SCENE_DIR VARIANT SPP OUT.exr [--area] [--spheres ellipsoids|sphere]
             [--integrator direct|path] [--depth N] [--threads N] [--reps N] [--seed S] [--res N]
Prints one line: build (scene load) s, first render s (with kernel compilation), min of warm renders s.
Spheres: `sphere` = one plugin per sphere (default), `ellipsoids` = one shape per material
(loads fast, but Mitsuba 3.9.1 draws its small spheres as boxes: Mitsuba 3.9.1 only).
Discs: one `disk` plugin each (Mitsuba has no disc set).  Polygons, boxes: triangle meshes.
"""
import argparse, json, time
import numpy as np
ap = argparse.ArgumentParser()
ap.add_argument('scene'); ap.add_argument('variant'); ap.add_argument('spp', type=int); ap.add_argument('out')
ap.add_argument('--area', action='store_true'); ap.add_argument('--spheres', default='auto')
ap.add_argument('--integrator', default='auto'); ap.add_argument('--depth', type=int, default=0, help='of paths, as Mitsuba counts'); ap.add_argument('--threads', type=int, default=2)
ap.add_argument('--reps', type=int, default=0); ap.add_argument('--seed', type=int, default=0)
ap.add_argument('--res', type=int, default=0, help='square resolution override')
A = ap.parse_args()
t0 = time.time()
import mitsuba as mi, drjit as dr
mi.set_variant(A.variant); dr.set_thread_count(A.threads)
T = mi.ScalarTransform4f
t_imp = time.time() - t0; t0 = time.time()
S = json.load(open(A.scene + '/scene.json')); raw = open(A.scene + '/data.bin', 'rb').read()
def arr(n):
    a = S['arrays'][n]; c = int(np.prod(a['shape']))
    return np.frombuffer(raw, '<' + a['dtype'], c, a['offset']).reshape(a['shape'])
c = S['camera']; L = S['light']
if A.res: c['width'] = c['height'] = A.res
integ = A.integrator if A.integrator != 'auto' else ('path' if S['max_depth'] else 'direct')
d = {'type': 'scene',
     'integrator': {'type': 'path', 'max_depth': A.depth or S['max_depth'] + 2, 'rr_depth': 1000} if integ == 'path' else
                   {'type': 'direct', 'emitter_samples': 1, 'bsdf_samples': 0},
     'sensor': {'type': 'perspective', 'fov': c['vfov_deg'], 'fov_axis': 'y',
                'to_world': T().look_at(origin=list(c['origin']), target=list(c['target']), up=list(c['up'])),
                'film': {'type': 'hdrfilm', 'width': c['width'], 'height': c['height'], 'rfilter': {'type': 'box'},
                         'pixel_format': 'rgb', 'component_format': 'float32'},
                'sampler': {'type': 'independent', 'sample_count': A.spp}}}
rgb = lambda v: {'type': 'rgb', 'value': list(v)}
for i, m in enumerate(S['materials']):
    d['m%d' % i] = ({'type': 'twosided', 'id': 'm%d' % i, 'b': {'type': 'diffuse', 'reflectance': rgb(m['albedo'])}} if m['kind'] == 'diffuse' else
                    {'type': 'twosided', 'id': 'm%d' % i, 'b': {'type': 'conductor', 'material': 'none', 'specular_reflectance': {'type': 'rgb', 'value': [m['reflectance']] * 3}}})
M = lambda i: {'type': 'ref', 'id': 'm%d' % i}
if A.area:
    s = L['size'] / 2; rad = L['intensity'] / L['size'] ** 2
    d['light'] = {'type': 'rectangle', 'to_world': T().look_at(origin=list(L['position']), target=list(L['target']), up=[0.3, 0.5, 0.7]) @ T().scale([s, s, 1]),
                  'emitter': {'type': 'area', 'radiance': rgb([rad] * 3)}}
else:
    d['light'] = {'type': 'point', 'position': list(L['position']), 'intensity': rgb([L['intensity']] * 3)}
sp, sm = arr('spheres'), arr('sphere_mat')
kind = A.spheres if A.spheres != 'auto' else 'sphere'
if kind == 'sphere':
    for i in range(len(sp)):
        d['s%d' % i] = {'type': 'sphere', 'center': [float(x) for x in sp[i, :3]], 'radius': float(sp[i, 3]), 'b': M(sm[i])}
else:
    for m in np.unique(sm):
        q = sp[sm == m]; n = len(q)
        d['e%d' % m] = {'type': 'ellipsoids', 'centers': mi.TensorXf(np.ascontiguousarray(q[:, :3])), 'scales': mi.TensorXf(np.repeat(q[:, 3:4], 3, 1)),
                        'quaternions': mi.TensorXf(np.tile(np.array([[0, 0, 0, 1]], np.float32), (n, 1))), 'extent': 1.0, 'b': M(m)}
for i, (p, m) in enumerate(zip(arr('discs'), arr('disc_mat'))):
    o = p[:3].astype(float); nn = p[4:7].astype(float)
    d['d%d' % i] = {'type': 'disk', 'to_world': T().look_at(origin=list(o), target=list(o + nn), up=[0, 0, 1] if abs(nn[2]) < .9 else [1, 0, 0]) @ T().scale([float(p[3])] * 3), 'b': M(m)}
def mesh(name, V, F, m):
    p = mi.Properties(); p['b'] = mi.load_dict({k: v for k, v in d['m%d' % m].items() if k != 'id'})
    me = mi.Mesh(name, len(V), len(F), props=p, has_vertex_normals=False, has_vertex_texcoords=False)
    pr = mi.traverse(me); pr['vertex_positions'] = np.ascontiguousarray(V, np.float32).ravel(); pr['faces'] = np.ascontiguousarray(F, np.uint32).ravel(); pr.update()
    d[name] = me
st = arr('poly_start').astype(np.int64); pm = arr('poly_mat'); pv = arr('poly_verts')
cnt = st[1:] - st[:-1]
for m in np.unique(pm):
    F = []
    for j in range(1, int(cnt.max()) - 1):
        k = np.nonzero((cnt > j + 1) & (pm == m))[0]; F.append(np.stack([st[k], st[k] + j, st[k] + j + 1], -1))
    F = np.concatenate(F); used, inv = np.unique(F, return_inverse=True); mesh('p%d' % m, pv[used], inv.reshape(-1, 3), m)
for i, (b, m) in enumerate(zip(arr('boxes'), arr('box_mat'))):
    ce, h = (b[:3] + b[3:]) / 2, (b[3:] - b[:3]) / 2
    d['b%d' % i] = {'type': 'cube', 'to_world': T().translate([float(x) for x in ce]) @ T().scale([float(x) for x in h]), 'b': M(m)}
for i, (p, m) in enumerate(zip(arr('planes'), arr('plane_mat'))):
    h = S['plane_half_extent']
    d['pl%d' % i] = {'type': 'rectangle', 'to_world': T().translate([float(x) for x in p[:3]]) @ T().scale([h, h, 1]), 'b': M(m)}
scene = mi.load_dict(d); dr.sync_thread()
t_load = time.time() - t0
def render(seed):
    t = time.time(); im = mi.render(scene, spp=A.spp, seed=seed)
    if A.variant.startswith('llvm'): dr.eval(im); dr.sync_thread()
    im = np.array(im)
    return im, time.time() - t
im, t1 = render(A.seed); warm = [render(A.seed + 1 + k)[1] for k in range(A.reps)]
mi.Bitmap(im).write(A.out)
print('mitsuba %s %s spp %d %s: import %.3f load %.3f render_first %.3f render_warm %s mean %.5f' % (
    A.variant, S['name'], A.spp, integ, t_imp, t_load, t1, '%.3f' % min(warm) if warm else '-', im.mean()))
