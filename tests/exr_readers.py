#!/usr/bin/env python3
"""Files that octray writes, as the two libraries read them that most programs use: OpenEXR and OpenImageIO.

    python3 tests/exr_readers.py [OCTRAY]

OCTRAY is the binary, target/release/octray where nothing is said. The script makes a Python environment of its own in
target/exr-readers and installs both libraries there by pip; EXR_READERS_PYTHON names a Python that has them already.
Every check is an assertion; the last line says how many held.
"""

import hashlib
import json
import os
import subprocess
import sys
import tempfile
import venv
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
OCTRAY = Path(sys.argv[1] if len(sys.argv) > 1 else ROOT / "target/release/octray").resolve()


def enter_environment():
    """Runs this script again in the environment that has the libraries."""
    python = os.environ.get("EXR_READERS_PYTHON")
    if python is None:
        room = ROOT / "target/exr-readers"
        python = room / "bin/python"
        if not python.exists():
            venv.create(room, with_pip=True)
        wanted = ["numpy", "OpenEXR>=3.3", "OpenImageIO>=3.0"]
        subprocess.run([python, "-m", "pip", "install", "-q", "--disable-pip-version-check", *wanted], check=True)
    os.execve(python, [str(python), __file__, str(OCTRAY)], {**os.environ, "EXR_READERS_INSIDE": "1"})


if "EXR_READERS_INSIDE" not in os.environ:
    enter_environment()

import numpy  # noqa: E402
import OpenEXR  # noqa: E402
import OpenImageIO as oiio  # noqa: E402

checks = 0


def check(holds, what):
    global checks
    assert holds, what
    checks += 1


def octray(*arguments, code=0):
    done = subprocess.run([OCTRAY, *map(str, arguments)], capture_output=True, text=True)
    assert done.returncode == code, f"octray {arguments}: {done.returncode}\n{done.stderr}"
    return done.stdout + done.stderr


# --- what the libraries see -------------------------------------------------------------------------------------


def by_openexr(path):
    """Parts as (name, header, {channel: pixels})."""
    with OpenEXR.File(str(path), separate_channels=True) as file:
        parts = []
        for part in file.parts:
            channels = {name: numpy.array(channel.pixels) for name, channel in part.channels.items()}
            parts.append((part.header.get("name", ""), dict(part.header), channels))
        return parts


def by_oiio(path):
    """The same from OpenImageIO: (spec, {channel: pixels})."""
    file = oiio.ImageInput.open(str(path))
    assert file, oiio.geterror()
    parts = []
    index = 0
    while file.seek_subimage(index, 0):
        spec = file.spec()
        channels = {}
        for number, name in enumerate(spec.channelnames):
            kind = spec.channelformat(number)
            channels[name] = file.read_image(index, 0, number, number + 1, kind)[:, :, 0]
        parts.append((spec, channels))
        index += 1
    file.close()
    return parts


def bits(pixels):
    return numpy.ascontiguousarray(pixels).view({2: numpy.uint16, 4: numpy.uint32}[pixels.dtype.itemsize])


def window(header, name):
    low, high = header[name]
    return tuple(int(x) for x in low), tuple(int(x) for x in high)


def layers(path):
    """All channels of a file, after both libraries agreed on all of it to the bit."""
    first, second = by_openexr(path), by_oiio(path)
    check(len(first) == len(second), f"{path.name}: {len(first)} and {len(second)} parts")
    everything = {}
    for (name, header, mine), (spec, theirs) in zip(first, second):
        check(set(mine) == set(theirs), f"{path.name} {name}: {sorted(mine)} and {sorted(theirs)}")
        for channel, pixels in mine.items():
            other = theirs[channel]
            check(pixels.dtype == other.dtype, f"{path.name} {channel}: {pixels.dtype} and {other.dtype}")
            same = numpy.array_equal(bits(pixels), bits(other))
            check(same or "dwa" in str(header["compression"]).lower(), f"{path.name} {channel}: pixels differ")
            check(pixels.dtype == numpy.uint32 or numpy.isfinite(pixels).all(), f"{path.name} {channel}: not finite")
            everything[channel] = pixels
        low, high = window(header, "dataWindow")
        check((spec.x, spec.y) == low and (spec.x + spec.width - 1, spec.y + spec.height - 1) == high, "data window")
        low, high = window(header, "displayWindow")
        full = (spec.full_x, spec.full_y), (spec.full_x + spec.full_width - 1, spec.full_y + spec.full_height - 1)
        check(full == (low, high), "display window")
    return first, everything


# --- what the files should hold -----------------------------------------------------------------------------------

HALF, FLOAT, UINT = numpy.dtype("float16"), numpy.dtype("float32"), numpy.dtype("uint32")
TYPES = {
    "depth": FLOAT, "P": FLOAT, "N": HALF, "albedo": HALF, "uv": FLOAT, "id": UINT, "samples": FLOAT, "forward": FLOAT,
    "variance": FLOAT, "crypto_object": FLOAT, "crypto_material": FLOAT, "crypto_asset": FLOAT,
}
NAMES = ("R G B A depth.Z P.X P.Y P.Z N.X N.Y N.Z albedo.R albedo.G albedo.B uv.U uv.V id.object id.material samples.Y "
         "variance.R variance.G variance.B forward.u forward.v").split()
NAMES += [f"crypto_{kind}{rank:02}.{c}" for kind in ("object", "material", "asset") for rank in range(3) for c in "RGBA"]


def check_types(path, channels):
    for name, pixels in channels.items():
        layer = name.split(".")[0].rstrip("0123456789") if "." in name else ""
        want = TYPES.get(layer, HALF)
        check(pixels.dtype == want, f"{path.name} {name}: {pixels.dtype}, should be {want}")


def text(value):
    return value.decode() if isinstance(value, bytes) else str(value)


def pixel_hash(parts, display):
    """The hash of all samples, by the words of src/output/pixel_hash.rs."""
    low, high = window(parts[0][1], "dataWindow")
    total = hashlib.sha256(f"octray pixels 1\n{display[0]} {display[1]} {low[0]} {low[1]} {high[0] + 1} {high[1] + 1}\n".encode())
    channels = {name: pixels for _, _, channels in parts for name, pixels in channels.items()}
    for name in sorted(channels, key=str.encode):
        pixels = channels[name]
        kind = {HALF: "half", FLOAT: "float", UINT: "uint"}[pixels.dtype]
        little = pixels.astype(pixels.dtype.newbyteorder("<"))
        rows = hashlib.sha256(b"".join(hashlib.sha256(row.tobytes()).digest() for row in little))
        total.update(f"{name} {kind}\n".encode() + rows.digest())
    return total.hexdigest()


def murmur3(data):
    """MurmurHash3_x86_32 with seed 0, of bytes."""
    mask = 0xFFFFFFFF
    turn = lambda x, r: ((x << r) | (x >> (32 - r))) & mask
    mix = lambda k: turn(k * 0xCC9E2D51 & mask, 15) * 0x1B873593 & mask
    h = 0
    for at in range(0, len(data) // 4 * 4, 4):
        h = (turn(h ^ mix(int.from_bytes(data[at:at + 4], "little")), 13) * 5 + 0xE6546B64) & mask
    h ^= mix(int.from_bytes(data[len(data) // 4 * 4:], "little")) ^ len(data)
    h = (h ^ h >> 16) * 0x85EBCA6B & mask
    h = (h ^ h >> 13) * 0xC2B2AE35 & mask
    return h ^ h >> 16


def crypto_id(name):
    h = murmur3(name.encode())
    return h ^ 1 << 23 if h >> 23 & 255 in (0, 255) else h


def check_cryptomattes(path, parts):
    for vector, value in (("torus", 4053562365), ("равнина", 2518896926)):
        check(murmur3(vector.encode()) == value, vector)
    for kind in ("crypto_object", "crypto_material", "crypto_asset"):
        key = f"{murmur3(kind.encode()):08x}"[:7]
        field = lambda header, name: header.get(f"cryptomatte/{key}/{name}")
        part = [part for part in parts if field(part[1], "name") is not None]
        check(len(part) == 1, f"{path.name}: {kind} has its metadata in {len(part)} parts")
        _, header, channels = part[0]
        check(text(field(header, "name")) == kind, kind)
        check(text(field(header, "hash")) == "MurmurHash3_32", kind)
        check(text(field(header, "conversion")) == "uint32_to_float32", kind)
        manifest = field(header, "manifest")
        if manifest is None:
            file = text(field(header, "manif_file"))
            check(file == f"{path.stem}.{kind}.json", file)
            manifest = (path.parent / file).read_text(encoding="utf-8")
        names = json.loads(text(manifest))
        check("\\u" not in text(manifest), "names are raw UTF-8")
        for name, number in names.items():
            check(number == f"{crypto_id(name):08x}", f"{name}: {number}")
        ranks = sorted(name for name in channels if name.startswith(kind))
        ids = numpy.concatenate([bits(channels[name]).ravel() for name in ranks if name[-1] in "RB"])
        seen = {f"{number:08x}" for number in numpy.unique(ids) if number}
        check(seen == set(names.values()), f"{path.name} {kind}: {len(seen)} ids seen, {len(names)} named")
        cover = [channels[name] for name in ranks if name[-1] in "GA"]
        check(all((rank >= 0).all() for rank in cover), "no coverage is negative")
        check((sum(cover) <= 1 + 1e-5).all(), "coverage is at most 1")


# --- the checks -----------------------------------------------------------------------------------------------------


def main(room):
    scene = ROOT / "scenes/mixed.toml"
    common = ["render", scene, "-q", "--no-date", "--resolution", "160x90", "--spp", "4"]
    everything = [*common, "--aov", "all"]
    path = lambda name: room / name

    # Beauty, all layers and Cryptomatte in one part.
    octray(*everything, "-o", path("all.exr"))
    parts, full = layers(path("all.exr"))
    check(len(parts) == 1 and set(full) == set(NAMES), f"{sorted(set(full) ^ set(NAMES))}")
    check_types(path("all.exr"), full)
    header = parts[0][1]
    check("ZIPS" in str(header["compression"]), str(header["compression"]))
    check(text(header["render/pixelHash"]) == pixel_hash(parts, (160, 90)), "pixel hash")
    check(header["render/spp"] == 4 and header["samplesPerPixel"] == 4, "spp")
    check(text(header["render/seed"]) == "0" and text(header["render/scene"]) == "mixed.toml", "seed, scene")
    check(len(text(header["render/sceneHash"])) == 64, "scene hash")
    check("capDate" not in header and "render/seconds" not in header, "no date")
    white = [float(x) for x in numpy.ravel(header["chromaticities"])][-2:]
    check(numpy.allclose(white, (0.3127, 0.3290), atol=1e-6), f"{white}")
    check("worldToCamera" in header and "worldToNDC" in header, "camera")
    check_cryptomattes(path("all.exr"), parts)
    octray(*everything, "-o", path("again.exr"), "--threads", "1")
    check(path("all.exr").read_bytes() == path("again.exr").read_bytes(), "equal renders are equal bytes")
    for name, pixels in full.items():
        radiance = name.split(".")[0] in ("R", "G", "B", "A", "depth", "albedo", "variance", "samples")
        check(not radiance or (pixels >= 0).all(), f"{name} is negative")

    # The same as parts, in other packings, with a date.
    octray(*everything, "-o", path("parts.exr"), "--multipart", "--compression", "zip")
    parts, found = layers(path("parts.exr"))
    check(parts[0][0] == "rgba" and len(parts) == 13, f"{len(parts)} parts")
    check_cryptomattes(path("parts.exr"), parts)
    check(all(numpy.array_equal(bits(found[name]), bits(full[name])) for name in NAMES), "parts hold the same")
    check(text(parts[0][1]["render/pixelHash"]) == text(header["render/pixelHash"]), "the hash is that of the samples")
    for packing in ("none", "rle", "zip", "piz"):
        octray(*everything, "-o", path("packed.exr"), "--compression", packing, "--crypto-sidecar")
        parts, found = layers(path("packed.exr"))
        check(all(numpy.array_equal(bits(found[name]), bits(full[name])) for name in NAMES), packing)
        check_cryptomattes(path("packed.exr"), parts)
    for packing in ("dwaa", "dwab", "pxr24"):
        octray(*everything, "-o", path("lossy.exr"), "--compression", packing)
        parts, found = layers(path("lossy.exr"))
        check(len(parts) == 2 and "ZIPS" in str(parts[1][1]["compression"]), packing)
        exact = [name for name in NAMES if full[name].dtype != HALF]
        check(all(numpy.array_equal(bits(found[name]), bits(full[name])) for name in exact), f"{packing}: exact layers")
        off = max(numpy.abs(found[c].astype(float) - full[c]).max() for c in "RGBA")
        check(off < 0.1, f"{packing}: colour is off by {off}")
        check_cryptomattes(path("lossy.exr"), parts)
    octray("render", scene, "-q", "--resolution", "16x9", "--spp", "1", "-o", path("dated.exr"))
    parts, _ = layers(path("dated.exr"))
    check("capDate" in parts[0][1] and "render/seconds" in parts[0][1], "a date")

    # Windows: a crop and an overscan are the same pixels.
    octray(*everything, "-o", path("crop.exr"), "--crop", "30,20,100,61")
    parts, crop = layers(path("crop.exr"))
    check(window(parts[0][1], "dataWindow") == ((30, 20), (99, 60)), "crop")
    check(window(parts[0][1], "displayWindow") == ((0, 0), (159, 89)), "frame")
    check(all(numpy.array_equal(bits(crop[name]), bits(full[name][20:61, 30:100])) for name in NAMES), "crop pixels")
    check_cryptomattes(path("crop.exr"), parts)
    octray(*everything, "-o", path("over.exr"), "--overscan", "8")
    parts, over = layers(path("over.exr"))
    check(window(parts[0][1], "dataWindow") == ((-8, -8), (167, 97)), "overscan")
    check(all(numpy.array_equal(bits(over[name][8:98, 8:168]), bits(full[name])) for name in NAMES), "overscan pixels")

    # Crops joined are the whole file.
    for number, crop in enumerate(("0,0,70,90", "70,0,160,50", "60,50,160,90")):
        octray(*everything, "-o", path(f"tile{number}.exr"), "--crop", crop)
    octray("merge", *(path(f"tile{number}.exr") for number in range(3)), "-o", path("merged.exr"))
    check(path("merged.exr").read_bytes() == path("all.exr").read_bytes(), "merged crops are the whole file")
    octray("merge", path("tile0.exr"), path("tile1.exr"), "-o", path("x.exr"), code=3)

    # ACEScg says so, and OpenImageIO's own matrix leads back.
    octray(*common, "--float", "-o", path("rec709.exr"))
    octray(*common, "--float", "-o", path("aces.exr"), "--color", "acescg")
    parts, aces = layers(path("aces.exr"))
    _, plain = layers(path("rec709.exr"))
    red = [float(x) for x in numpy.ravel(parts[0][1]["chromaticities"])][:2]
    check(numpy.allclose(red, (0.713, 0.293), atol=1e-6), f"{red}")
    matrix = numpy.array([[0.6131, 0.3395, 0.0474], [0.0702, 0.9164, 0.0135], [0.0206, 0.1096, 0.8698]])
    want = numpy.stack([plain[c] for c in "RGB"], -1) @ matrix.T
    got = numpy.stack([aces[c] for c in "RGB"], -1)
    check(numpy.allclose(got, want, rtol=2e-3, atol=2e-4), "primaries")

    # A foreground over a background is the render with that background.
    foreground_over_background(room)
    foreign_files(room)
    every_scene(room)


def foreground_over_background(room):
    text = (ROOT / "scenes/fig5.toml").read_text(encoding="utf-8")
    head, _, rest = text.partition("[background]")
    assert rest, "fig5.toml has a background"
    tail = rest.partition("\n[")[2]
    scene = room / "over.toml"
    scene.write_text(f"{head}[background]\ncolor = [0.3, 0.5, 0.2]\n\n[{tail}", encoding="utf-8")
    common = ["render", scene, "-q", "--float", "--resolution", "160x120", "--spp", "16"]
    octray(*common, "-o", room / "whole.exr")
    octray(*common, "-o", room / "front.exr", "--background", "transparent")
    front = oiio.ImageBuf(str(room / "front.exr"))
    back = oiio.ImageBuf(oiio.ImageSpec(160, 120, 4, "float"))
    oiio.ImageBufAlgo.fill(back, (0.3, 0.5, 0.2, 1.0))
    whole = oiio.ImageBuf(str(room / "whole.exr"))
    over = oiio.ImageBufAlgo.over(front, back)
    check(not over.has_error, over.geterror())
    got, want = (image.get_pixels(roi=oiio.ROI(0, 160, 0, 120))[:, :, :3] for image in (over, whole))
    check(numpy.abs(got - want).max() < 2e-6, f"over: {numpy.abs(got - want).max()}")
    check((front.spec().width, front.spec().height) != (0, 0), "front")


def every_scene(room):
    """All layers of every scene that is shipped: nothing that spreads, and nothing negative where that has no meaning."""
    scenes = [*(ROOT / "scenes").glob("*.toml"), *(ROOT / "scenes/nff").glob("*.nff*")]
    scenes += [path for path in (ROOT / "scenes/particles").iterdir() if path.is_file() and path.suffix != ".md"]
    check(len(scenes) > 50, f"{len(scenes)} scenes")
    for scene in sorted(scenes):
        octray("render", scene, "-q", "--resolution", "80x60", "--spp", "4", "--aov", "all,margin,cost", "-o", room / "scene.exr")
        _, channels = layers(room / "scene.exr")
        check(len(channels) > 60, f"{scene}: {len(channels)} channels")
        for name, pixels in channels.items():
            is_id = name.startswith("crypto") and name[-1] in "RB"
            signed = is_id or name.split(".")[0] in ("P", "N", "uv", "forward", "margin")
            check(pixels.dtype.kind == "u" or numpy.isfinite(pixels).all(), f"{scene}: {name} is finite")
            check(signed or (pixels >= 0).all(), f"{scene}: {name} is not negative")


def foreign_files(room):
    """Files by both libraries, read by octray to the bit."""
    height, width = 37, 45
    rng = numpy.random.default_rng(5)
    color = {name: rng.random((height, width)).astype("float16") for name in "RGBA"}
    more = {"depth.Z": rng.random((height, width)).astype("float32"),
            "id.object": rng.integers(0, 2**32, (height, width)).astype("uint32")}
    for compression in ("NO", "RLE", "ZIPS", "ZIP", "PIZ"):
        header = {"compression": getattr(OpenEXR, f"{compression}_COMPRESSION"), "type": OpenEXR.scanlineimage}
        with OpenEXR.File(header, {**color, **more}) as file:
            file.write(str(room / "foreign.exr"))
        octray("convert", room / "foreign.exr", room / "back.exr")
        _, back = layers(room / "back.exr")
        check(all(numpy.array_equal(bits(back[name]), bits(pixels)) for name, pixels in {**color, **more}.items()),
              f"OpenEXR, {compression}")
    parts = [OpenEXR.Part({"type": OpenEXR.scanlineimage}, dict(color), name="beauty"),
             OpenEXR.Part({"type": OpenEXR.scanlineimage}, {"Z": more["depth.Z"]}, name="depth")]
    with OpenEXR.File(parts) as file:
        file.write(str(room / "foreign.exr"))
    octray("convert", room / "foreign.exr", room / "back.exr")
    _, back = layers(room / "back.exr")
    check(numpy.array_equal(bits(back["depth.Z"]), bits(more["depth.Z"])), "OpenEXR, parts")
    for compression in ("none", "rle", "zips", "zip", "piz", "pxr24", "dwaa", "dwab", "b44"):
        for tile in (0, 16):
            for kind in ("half", "float", "uint"):
                if kind == "uint" and compression in ("dwaa", "dwab"):
                    continue
                spec = oiio.ImageSpec(width, height, 4, kind)
                spec.attribute("compression", compression)
                if tile:
                    spec.tile_width = spec.tile_height = tile
                image = oiio.ImageBuf(spec)
                pixels = numpy.stack([color[name] for name in "RGBA"], -1).astype("float32")
                image.set_pixels(image.roi, pixels)
                check(image.write(str(room / "foreign.exr")), image.geterror())
                octray("convert", "--float", room / "foreign.exr", room / "back.exr")
                _, back = layers(room / "back.exr")
                theirs = {name: pixels.astype("float32") for name, pixels in by_oiio(room / "foreign.exr")[0][1].items()}
                off = max(numpy.abs(back[name] - theirs[name]).max() for name in "RGBA")
                check(off <= (1e-3 if compression in ("dwaa", "dwab") else 0), f"OpenImageIO, {compression} {kind} {tile}: {off}")


with tempfile.TemporaryDirectory() as room:
    main(Path(room))
print(f"exr_readers: {checks} checks held, OpenEXR {OpenEXR.__version__ if hasattr(OpenEXR, '__version__') else ''}, "
      f"OpenImageIO {oiio.VERSION_STRING}")
