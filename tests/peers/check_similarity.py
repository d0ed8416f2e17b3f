"""Distances of Similarity against OpenCV, to the integer: pyrDown, then matchTemplate with a disc for a mask.

Usage: check_similarity.py WARPLOOM.
"""

import pathlib
import subprocess
import sys
import tempfile

import cv2
import numpy as np
import OpenImageIO as oiio

BORDERS = {"Mirror": cv2.BORDER_REFLECT_101, "Wrap": cv2.BORDER_WRAP, "Clamp": cv2.BORDER_REPLICATE}
# Width, height, diameter, levels, selection pixels.
CASES = [
    (64, 48, 1, [0], [(3, 5)]),
    (65, 47, 3, [0, 1], [(64, 46)]),
    (97, 61, 5, [0, 1], [(0, 0)]),
    (96, 64, 5, [1, 2], [(33, 20)]),
    (101, 77, 7, [2, 0], [(50, 76)]),
    (128, 70, 9, [0], [(127, 1)]),
    (83, 90, 9, [3], [(10, 80)]),
    (90, 83, 5, [0, 1, 3], [(10, 80), (77, 3), (45, 45)]),
]


def disc(diameter):
    reach = np.arange(diameter) - diameter // 2
    return (4 * (reach[:, None] ** 2 + reach[None, :] ** 2) <= diameter**2).astype(np.uint8)


def level_distance(picture, point, diameter, border):
    """What matchTemplate says of a level, every neighbourhood being whole."""
    reach, (x, y) = diameter // 2, point
    padded = cv2.copyMakeBorder(picture, reach, reach, reach, reach, border)
    template = padded[y : y + diameter, x : x + diameter]
    mask = np.repeat(disc(diameter)[:, :, None], 3, 2)
    found = cv2.matchTemplate(padded, template, cv2.TM_SQDIFF, mask=mask)
    whole = np.rint(found)
    assert np.abs(found - whole).max() < 0.5 and found.shape == picture.shape[:2]
    return whole.astype(np.int64)


def distance(picture, point, diameter, levels, border):
    height, width = picture.shape[:2]
    total = np.zeros((height, width), np.int64)
    for level in range(max(levels) + 1):
        if level in levels:
            place = (point[0] >> level, point[1] >> level)
            found = level_distance(picture, place, diameter, border)
            total += np.repeat(np.repeat(found, 1 << level, 0), 1 << level, 1)[:height, :width]
        picture = cv2.pyrDown(picture, borderType=border)
    return total


def ours(warploom, folder, diameter, levels, points, boundary):
    at = ", ".join(f"({x}.5, {y}.5)" for x, y in points)
    graph = folder / "graph.ron"
    graph.write_text(f"""Graph(version: 1, nodes: {{
        "picture": Load(path: "picture.png"),
        "guide": SimilarityGuide(image: "picture", diameter: {diameter}, levels: {levels}, boundary: {boundary}),
        "map": Similarity(guide: "guide", at: [{at}], distance: 900000.0, strength: 0.75),
    }})""")
    dumps = [f"--dump=map.{port}={folder / port}.exr" for port in ("distance", "strength")]
    command = [warploom, "run", graph, "--no-cache", "--progress", "none", *dumps]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, f"exit {done.returncode}\n{done.stderr}"
    read = lambda port: oiio.ImageBuf(str(folder / f"{port}.exr")).get_pixels(oiio.FLOAT)[:, :, 0]
    return read("distance"), read("strength")


def main():
    warploom = pathlib.Path(sys.argv[1]).resolve()
    random = np.random.default_rng(7)
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        for width, height, diameter, levels, points in CASES:
            noise = random.integers(0, 256, (height, width, 3)).astype(np.uint8)
            # Half of the picture smooth, half of it as wild as codes can be.
            picture = np.where(np.arange(width)[None, :, None] < width // 2, cv2.GaussianBlur(noise, (0, 0), 1.5), noise)
            cv2.imwrite(str(folder / "picture.png"), picture)
            for boundary, border in BORDERS.items():
                theirs = np.min([distance(picture, point, diameter, levels, border) for point in points], 0)
                found, strength = ours(warploom, folder, diameter, levels, points, boundary)
                expected = theirs.astype(np.float32)
                assert (found == expected).all(), f"{np.abs(found - expected).max()} apart: {diameter} {levels} {boundary}"
                opacity = 0.75 * np.maximum(0, 1 - theirs / 9e5)
                assert np.abs(strength - opacity).max() < 1e-6
            print(f"{width} x {height}, diameter {diameter}, levels {levels}: equal, largest {theirs.max()}")


main()
