"""Warps as pictures against OpenImageIO: the files as it reads them, and pictures that its st_warp draws with them.

Usage: check_warp.py WARPLOOM.

st_warp multiplies by the size of the format and leaves its origin out, so pictures are compared at origin (0, 0). Its
triangle filter is bilinear; near the border the edges differ, so pixels that come from there are left out.
"""

import pathlib
import subprocess
import sys
import tempfile

import numpy as np
import OpenImageIO as oiio

WIDTH, HEIGHT, OVERSCAN = 320, 200, 24
WARPS = {
    "identity": "Affine(grid: \"grid\")",
    "translation": "Affine(grid: \"grid\", translate: (3.25, -7.5))",
    "rotation": "Affine(grid: \"grid\", rotate: 10.0)",
    "bulge": "Bulge(grid: \"grid\", bend: 15.0)",
    "turbulence": "Turbulence(grid: \"grid\", amount: 6.0, scale: 90.0)",
}
# Preset, channel names in file order, and a position's numbers undone: to px, y down, from numbers and pixel centres.
PRESETS = {
    "NukeStMap": (("R", "G", "A"), lambda u, v, x, y: (u * WIDTH, HEIGHT - v * HEIGHT)),
    "NukeIDistort": (("forward.u", "forward.v", "A"), lambda u, v, x, y: (x + u, y - v)),
    "OiioStWarp": (("R", "G", "A"), lambda u, v, x, y: (u * WIDTH, v * HEIGHT)),
    "BlenderMapUv": (("R", "G", "B"), lambda u, v, x, y: (u * WIDTH, HEIGHT - v * HEIGHT)),
    "BlenderDisplace": (("R", "G", "A"), lambda u, v, x, y: (x - u, y + v)),
}


def plate(path, origin=(0, 0)):
    """Smooth waves, whose values differ wherever a position does."""
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH]
    pixels = np.stack([np.sin(x / 9), np.cos(y / 7), np.sin((x + 2 * y) / 11), np.ones_like(x)], -1)
    spec = oiio.ImageSpec(WIDTH, HEIGHT, 4, "float")
    (spec.x, spec.y), (spec.full_x, spec.full_y) = origin, origin
    out = oiio.ImageOutput.create(str(path))
    assert out.open(str(path), spec) and out.write_image((0.5 + 0.5 * pixels).astype(np.float32)), out.geterror()
    out.close()


def run(warploom, folder, nodes):
    graph = folder / "graph.ron"
    graph.write_text(f"Graph(version: 1, nodes: {{ {nodes} }})")
    done = subprocess.run(
        [warploom, "run", graph, "--no-cache", "--progress", "none"], capture_output=True, text=True
    )
    assert done.returncode == 0, f"exit {done.returncode}\n{done.stderr}\n{nodes}"


def graph(warp, presets):
    maps = (f'"{p}": SaveWarp(warp: "warp", domain: "plate", path: "{p}.exr", preset: {p}, overscan: {OVERSCAN})' for p in presets)
    return f"""
        "plate": Load(path: "plate.exr"),
        "grid": Lattice(domain: "plate", cell: 4.0, overscan: {OVERSCAN}),
        "warp": {warp},
        "drawn": Resample(image: "plate", warp: "warp", filter: Linear, edge: Clamp),
        "out": Save(image: "drawn", path: "drawn.exr"),
        {", ".join(maps)}"""


def read(path, names):
    """The numbers of a map by channel, once its form is as expected."""
    image = oiio.ImageInput.open(str(path))
    assert image, oiio.geterror()
    spec = image.spec()
    assert set(spec.channelnames) == set(names), spec.channelnames
    assert spec.format == oiio.FLOAT and not spec.channelformats, (spec.format, spec.channelformats)
    assert spec.get_string_attribute("colorInteropID") == "data"
    pixels = image.read_image(0, 0, 0, spec.nchannels, oiio.FLOAT)
    return spec, [pixels[:, :, spec.channelnames.index(name)].astype(np.float64) for name in names]


def window(spec):
    return [(spec.x, spec.y, spec.width, spec.height), (spec.full_x, spec.full_y, spec.full_width, spec.full_height)]


def check_files(folder, origin):
    """All presets tell the same positions; gives these, of the format's pixels."""
    grown = (origin[0] - OVERSCAN, origin[1] - OVERSCAN, WIDTH + 2 * OVERSCAN, HEIGHT + 2 * OVERSCAN)
    positions = []
    for preset, (names, undo) in PRESETS.items():
        spec, (u, v, alpha) = read(folder / f"{preset}.exr", names)
        assert window(spec) == [grown, (*origin, WIDTH, HEIGHT)], f"{preset}: {window(spec)}"
        assert (alpha == 1).all(), preset
        y, x = np.mgrid[0 : grown[3], 0 : grown[2]] + 0.5 - OVERSCAN
        positions.append(np.stack(undo(u, v, x, y), -1))
    worst = max(np.abs(p - positions[0]).max() for p in positions)
    assert worst < 2e-4, f"presets differ by {worst} px"
    return positions[0][OVERSCAN:-OVERSCAN, OVERSCAN:-OVERSCAN], worst


def check_picture(folder, positions):
    """Our picture against st_warp's through our map, away from the edges."""
    source, st = (oiio.ImageBuf(str(folder / name)) for name in ("plate.exr", "OiioStWarp.exr"))
    names = st.spec().channelnames
    theirs = oiio.ImageBufAlgo.st_warp(source, st, "triangle", 2.0, names.index("R"), names.index("G"))
    assert not theirs.has_error, theirs.geterror()
    format_ = oiio.ROI(0, WIDTH, 0, HEIGHT)
    theirs = theirs.get_pixels(oiio.FLOAT, format_)
    ours = oiio.ImageBuf(str(folder / "drawn.exr")).get_pixels(oiio.FLOAT, format_)
    inside = (positions >= 2).all(-1) & (positions <= (WIDTH - 2, HEIGHT - 2)).all(-1)
    assert inside.mean() > 0.6, inside.mean()
    return np.abs(ours - theirs)[inside].max()


def main():
    warploom = pathlib.Path(sys.argv[1]).resolve()
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        for warp, text in WARPS.items():
            for origin in ((0, 0), (100, 50)):
                plate(folder / "plate.exr", origin)
                run(warploom, folder, graph(text, PRESETS))
                positions, apart = check_files(folder, origin)
                line = f"{warp} at {origin}: presets agree within {apart:.1e} px"
                if warp == "identity":
                    y, x = np.mgrid[0:HEIGHT, 0:WIDTH] + 0.5
                    assert np.abs(positions - np.stack([x, y], -1)).max() < 1e-4
                if origin == (0, 0):
                    worst = check_picture(folder, positions)
                    assert worst <= 1e-5, f"{warp}: the picture differs from st_warp's by {worst}"
                    line += f", the picture is st_warp's within {worst:.1e}"
                print(line)


main()
