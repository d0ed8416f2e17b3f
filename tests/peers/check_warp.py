"""Warps that SaveWarp writes and LoadWarp reads, against OpenImageIO: `st_warp` draws the same, files hold what is meant.

Usage: check_warp.py WARPLOOM
"""

import itertools
import pathlib
import subprocess
import sys
import tempfile

import numpy as np
import OpenImageIO as oiio

WIDTH, HEIGHT = 96, 64
WARPS = {
    "identity": 'Affine(grid: "grid")',
    "translation": 'Affine(grid: "grid", translate: (3.25, -7.5))',
    "rotation": 'Affine(grid: "grid", rotate: 10.0)',
    "radial": 'Lens(grid: "grid", k: (0.08, 0.0, 0.0))',
    "bulge": 'Bulge(grid: "grid", bend: 20.0)',
    "smooth": 'Turbulence(grid: "grid", amount: 4.0, scale: 40.0)',
}
# Channels, and the numbers of a pixel centred at c that comes from p, both in px from the upper left corner of the
# format, written down from what the programs document.
PRESETS = {
    "NukeStMap": (("R", "G", "A"), lambda c, p, w, h: (p[0] / w, (h - p[1]) / h)),
    "NukeIDistort": (("forward.u", "forward.v", "A"), lambda c, p, w, h: (p[0] - c[0], c[1] - p[1])),
    "OiioStWarp": (("R", "G", "A"), lambda c, p, w, h: (p[0] / w, p[1] / h)),
    "BlenderMapUv": (("R", "G", "B"), lambda c, p, w, h: (p[0] / w, (h - p[1]) / h)),
    "BlenderDisplace": (("R", "G", "A"), lambda c, p, w, h: (c[0] - p[0], p[1] - c[1])),
}


class Warploom:
    def __init__(self, program, folder):
        self.program, self.folder = program, folder

    def exit_code(self, nodes):
        graph = self.folder / "graph.ron"
        graph.write_text(f"Graph(version: 1, nodes: {{ {nodes} }})")
        command = [self.program, "run", graph, "--no-cache", "--progress", "none"]
        run = subprocess.run(command, capture_output=True, text=True)
        return run.returncode, f"{nodes}\n{run.stderr}"

    def run(self, nodes):
        code, text = self.exit_code(nodes)
        assert code == 0, f"exit {code}\n{text}"


def write(path, pixels, names, origin=(0, 0), kind="float"):
    height, width = pixels.shape[:2]
    spec = oiio.ImageSpec(width, height, len(names), kind)
    spec.channelnames = names
    spec.x, spec.y = spec.full_x, spec.full_y = origin
    out = oiio.ImageOutput.create(str(path))
    assert out.open(str(path), spec) and out.write_image(pixels.astype(np.float32)), out.geterror()
    out.close()


def centers(width, height, overscan=0):
    ys, xs = np.mgrid[-overscan : height + overscan, -overscan : width + overscan]
    return np.stack([xs + 0.5, ys + 0.5])


def plate():
    """A smooth opaque picture: rounding of positions hardly shows."""
    x, y = centers(WIDTH, HEIGHT)
    red = 0.5 + 0.3 * np.sin(0.11 * x + 0.07 * y) + 0.15 * np.cos(0.065 * x - 0.13 * y)
    return np.stack([red, red[::-1], red[:, ::-1], np.ones_like(red)], -1).astype(np.float32)


def assert_drawn_as_st_warp(picture, st_map, drawn, name):
    """Equal wherever the four pixels that are mixed lie inside."""
    st = oiio.ImageBuf(str(st_map))
    expected = oiio.ImageBufAlgo.st_warp(oiio.ImageBuf(str(picture)), st, "triangle")
    assert not expected.has_error, expected.geterror()
    window = oiio.ROI(0, WIDTH, 0, HEIGHT, 0, 1, 0, 4)
    ours, theirs = (image.get_pixels(oiio.FLOAT, window) for image in (oiio.ImageBuf(str(drawn)), expected))
    s, t = np.moveaxis(st.get_pixels(oiio.FLOAT, window)[:, :, :2], -1, 0).astype(np.float64)
    x, y = s * WIDTH, t * HEIGHT
    inside = (x > 1) & (x < WIDTH - 1) & (y > 1) & (y < HEIGHT - 1)
    assert inside.mean() > 0.7, f"{name}: {inside.mean()} of the pixels are compared"
    worst = np.abs(ours - theirs)[inside].max()
    assert worst <= 1e-5, f"{name}: {worst}"
    return worst


def check_drawing(warploom):
    folder = warploom.folder
    write(folder / "plate.exr", plate(), ("R", "G", "B", "A"))
    worst = 0.0
    for name, warp in WARPS.items():
        warploom.run(
            f""""plate": Load(path: "plate.exr"), "grid": Lattice(domain: "plate", cell: 4.0, overscan: 16.0),
            "warp": {warp}, "map": SaveWarp(warp: "warp", domain: "plate", path: "map.exr", preset: OiioStWarp),
            "drawn": Resample(image: "plate", warp: "warp", filter: Linear), "out": Save(image: "drawn", path: "out.exr")"""
        )
        worst = max(worst, assert_drawn_as_st_warp(folder / "plate.exr", folder / "map.exr", folder / "out.exr", name))
    # A map made elsewhere.
    x, y = centers(WIDTH, HEIGHT)
    st = np.stack([(x + 3 * np.sin(0.09 * y)) / WIDTH, (y + 2 * np.cos(0.07 * x) + 0.3) / HEIGHT], -1)
    write(folder / "map.exr", st, ("R", "G"))
    draw = """"plate": Load(path: "plate.exr"), "map": LoadWarp(path: "map.exr", preset: OiioStWarp, domain: "plate"),
        "drawn": Resample(image: "plate", warp: "map", filter: Linear), "out": Save(image: "drawn", path: "out.exr")"""
    warploom.run(draw)
    worst = max(worst, assert_drawn_as_st_warp(folder / "plate.exr", folder / "map.exr", folder / "out.exr", "foreign"))
    write(folder / "map.exr", st, ("R", "G"), kind="half")
    code, text = warploom.exit_code(draw)
    assert code == 4 and "allow_half" in text, f"half must be refused, exit {code}\n{text}"
    return worst


def check_files(warploom):
    folder, overscan, count = warploom.folder, 64, 0
    for origin, (preset, (names, numbers)) in itertools.product(((0, 0), (100, 50)), PRESETS.items()):
        case = f"{preset} at {origin}"
        write(folder / "plate.exr", plate(), ("R", "G", "B", "A"), origin)
        warploom.run(
            f""""plate": Load(path: "plate.exr"), "grid": Lattice(domain: "plate", cell: 8.0),
            "warp": Affine(grid: "grid", translate: (3.25, -7.5)),
            "map": SaveWarp(warp: "warp", domain: "plate", path: "map.exr", preset: {preset}, overscan: {overscan})"""
        )
        image = oiio.ImageBuf(str(folder / "map.exr"))
        spec, (x, y) = image.spec(), origin
        data = (x - overscan, y - overscan, WIDTH + 2 * overscan, HEIGHT + 2 * overscan)
        assert (spec.x, spec.y, spec.width, spec.height) == data, f"{case}: {spec.x, spec.y, spec.width, spec.height}"
        assert (spec.full_x, spec.full_y, spec.full_width, spec.full_height) == (x, y, WIDTH, HEIGHT), case
        assert sorted(spec.channelnames) == sorted(names), f"{case}: {spec.channelnames}"
        assert spec.format == oiio.TypeDesc("float") and not spec.channelformats, f"{case}: {spec.format}"
        assert spec["compression"] == "zips" and spec["colorInteropID"] == "data", case
        planes = dict(zip(spec.channelnames, np.moveaxis(image.get_pixels(oiio.FLOAT), -1, 0)))
        at = centers(WIDTH, HEIGHT, overscan)
        expected = numbers(at, (at[0] - 3.25, at[1] + 7.5), WIDTH, HEIGHT)
        for name, values in zip(names, (*expected, np.ones_like(at[0]))):
            # A difference of 1e-3 px, in either unit.
            far = np.abs(planes[name] - values).max() * (1 if preset in ("NukeIDistort", "BlenderDisplace") else WIDTH)
            assert far <= 1e-3, f"{case}, {name}: {far}"
        count += 1
    return count


def main():
    with tempfile.TemporaryDirectory() as name:
        warploom = Warploom(pathlib.Path(sys.argv[1]).resolve(), pathlib.Path(name))
        worst = check_drawing(warploom)
        print(f"{len(WARPS) + 1} pictures are as st_warp draws them, within {worst:.1e}; a map of halves is refused")
        print(f"{check_files(warploom)} maps hold the documented numbers, channels and windows")


main()
