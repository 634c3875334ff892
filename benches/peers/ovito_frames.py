"""Frames of a trajectory by OVITO's Tachyon renderer: python ovito_frames.py TRAJ.xyz FRAMES RADIUS OUT

Needs a Python with the `ovito` package (MIT licence; 3.12 renders without a Vulkan driver, 3.17 does not). The picture is that
of particles.py: its camera, 640x480, no antialiasing, no ambient occlusion, one light with shadows (OVITO has a directional
one), a PNG a frame. Prints seconds from the first frame on, since a start takes OVITO a second.
"""
import math, os, sys, time

os.environ.setdefault('QT_QPA_PLATFORM', 'offscreen')
import numpy
from ovito.io import import_file
from ovito.vis import TachyonRenderer, Viewport

path, frames, radius, out = sys.argv[1], int(sys.argv[2]), float(sys.argv[3]), sys.argv[4]
pipeline = import_file(path)
pipeline.add_to_scene()
if pipeline.compute(0).cell is not None: pipeline.compute(0).cell.vis.enabled = False

def size(_, data):
    data.particles_.create_property('Radius', data=numpy.full(data.particles.count, radius))

pipeline.modifiers.append(size)
view = Viewport(type=Viewport.Type.Perspective, camera_pos=(0.9, 0.7, 2.2), camera_dir=(-0.9, -0.7, -2.2), camera_up=(0, 1, 0),
                fov=math.radians(30))
renderer = TachyonRenderer(ambient_occlusion=False, antialiasing=False, direct_light=True, shadows=True, max_ray_recursion=2)
os.makedirs(out, exist_ok=True)
picture = lambda f: view.render_image(size=(640, 480), filename=f'{out}/{f}.png', background=(0, 0, 0), frame=f, renderer=renderer)
picture(0)
start = time.time()
for f in range(1, frames): picture(f)
print((time.time() - start) / max(frames - 1, 1))
