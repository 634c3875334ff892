#!/usr/bin/env python3
"""What a compositor does with octray's layers, in numpy: over, a matte, another light.

    octray render scenes/fig5.toml -o front.exr --resolution 320x240 --background transparent --aov normal,albedo,cryptomatte
    octray render scenes/mixed.toml -o back.exr --resolution 320x240
    python3 scenes/pictures/compositing.py front.exr back.exr
    for name in over matte relit; do octray convert $name.exr $name.png; done

Needs the packages numpy and OpenImageIO.
"""

import json
import sys

import numpy as np
import OpenImageIO as oiio


def load(name):
    """All channels of the full frame by their names, 0 outside the data window, and the header."""
    image = oiio.ImageBuf(name)
    pixels = image.get_pixels(oiio.FLOAT, image.roi_full)
    return dict(zip(image.spec().channelnames, np.moveaxis(pixels, -1, 0))), image.spec()


def save(name, rgb):
    height, width, _ = rgb.shape
    image = oiio.ImageBuf(oiio.ImageSpec(width, height, 3, "half"))
    image.set_pixels(image.roi, np.ascontiguousarray(rgb, dtype=np.float32))
    assert image.write(name), image.geterror()


def stack(layer, names):
    return np.stack([layer[name] for name in names], axis=-1)


def matte(layer, header, kind, name):
    """How much of each pixel the object (material, asset) of this name covers: Cryptomatte."""
    keys = [a.name.rsplit("/", 1)[0] for a in header.extra_attribs if a.value == kind]
    names = json.loads(header.getattribute(keys[0] + "/manifest"))
    wanted = int(names[name], 16)
    coverage = np.zeros_like(layer["A"])
    for rank in range(3):
        for identity, share in ("RG", "BA"):
            ids = layer[f"{kind}{rank:02}.{identity}"].view(np.uint32)
            coverage += np.where(ids == wanted, layer[f"{kind}{rank:02}.{share}"], 0)
    return coverage[..., None]


def main(front_name, back_name):
    front, header = load(front_name)
    back = stack(load(back_name)[0], "RGB")
    beauty, alpha = stack(front, "RGB"), front["A"][..., None]

    # Beauty is premultiplied: what it leaves uncovered shows the picture behind it.
    save("over.exr", beauty + (1 - alpha) * back)

    # The terracotta parts turn blue, antialiased edges included.
    share = matte(front, header, "crypto_material", "terracotta")
    blue = beauty[..., ::-1] * [0.6, 0.8, 1.2]
    save("matte.exr", beauty * (1 - share) + blue * share + (1 - alpha) * back)

    # A light from the right that was not there: albedo times the cosine of normal and light.
    normal, albedo = stack(front, ["N.X", "N.Y", "N.Z"]), stack(front, ["albedo.R", "albedo.G", "albedo.B"])
    light = np.array([0.9, 0.2, 0.4]) / np.linalg.norm([0.9, 0.2, 0.4])
    cosine = np.clip(normal @ light, 0, None)[..., None]
    relit = albedo * (0.05 + cosine * [1.1, 0.9, 0.7])
    save("relit.exr", relit + (1 - alpha) * back)


main(*sys.argv[1:3])
