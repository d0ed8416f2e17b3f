"""Resampling beside OpenCV's remap and OpenImageIO's st_warp: RGBA f32, one thread, processor time, medians.

Three cases: a dense map (a node per pixel corner) of a smooth warp and of a swirl of 3 rad, and the smooth warp as a
forward lattice of 5 px cells, beside remap through the dense inverse of the same warp. Prints each rate, the ratio to
remap and the target. The PSNR is that of each result to an
f64 sum with its own kernel: Keys' with a = -1/2 for ours, a = -3/4 for remap.
Usage: bench_resample.py EXAMPLE [SIZE]      (EXAMPLE: the release build of tests/examples/resample.rs)
"""

import pathlib
import statistics
import subprocess
import sys
import tempfile
import time

import cv2
import numpy as np
import OpenImageIO as oiio

REPEATS, TARGET = 7, 3.0


def smooth(x, y, size):
    """Where the pixel comes from: moved by some per cent of the size."""
    w = 2 * np.pi / size
    return x + 0.02 * size * np.sin(2 * w * y), y + 0.02 * size * np.cos(2 * w * x)


def swirl(x, y, size):
    """Where the pixel comes from: turned by 3 rad in the middle, not at all at the inscribed circle."""
    dx, dy = x - size / 2, y - size / 2
    angle = 3.0 * np.maximum(0.0, 1.0 - np.hypot(dx, dy) / (size / 2)) ** 2
    c, s = np.cos(angle), np.sin(angle)
    return size / 2 + c * dx - s * dy, size / 2 + s * dx + c * dy


def lattice(size, spacing, function):
    at = np.arange(-(-size // spacing) + 1) * float(spacing)
    return np.stack(np.broadcast_arrays(*function(at[None, :], at[:, None], size)))


def means(nodes):
    """The bilinear map at pixel centres, nodes at pixel corners."""
    half = 0.5 * (nodes[:, 1:] + nodes[:, :-1])
    return 0.5 * (half[:, :, 1:] + half[:, :, :-1])


def inverse(size, function):
    """Where the pixel centres come from if `function` says where they go; it moves its neighbours nearly alike."""
    at = np.arange(size) + 0.5
    targets = np.stack(np.broadcast_arrays(at[None, :], at[:, None]))
    found = targets
    for _ in range(30):
        found = found + targets - np.stack(function(found[0], found[1], size))
    return found


def keys(t, a):
    outer = lambda d: ((a * d - 5 * a) * d + 8 * a) * d - 4 * a
    inner = lambda d: ((a + 2) * d - (a + 3)) * d * d + 1
    return np.stack([outer(1 + t), inner(t), inner(1 - t), outer(2 - t)])


def exact(planes, positions, a, rows):
    """Rows of the picture filtered in f64."""
    size = planes.shape[1]
    x, y = positions[:, rows] - 0.5
    column, line = np.floor(x).astype(int), np.floor(y).astype(int)
    across, down = keys(x - column, a), keys(y - line, a)
    total = np.zeros((4,) + x.shape)
    for j in range(4):
        for i in range(4):
            c, r = column + i - 1, line + j - 1
            held = (c >= 0) & (c < size) & (r >= 0) & (r < size)
            total += across[i] * down[j] * held * planes[:, r.clip(0, size - 1), c.clip(0, size - 1)]
    return total


def psnr(found, expected):
    return 10 * np.log10(1.0 / max(np.mean((found - expected) ** 2), 1e-30))


def ours(example, folder, planes, nodes, spacing, direction):
    size = planes.shape[1]
    planes.astype("<f4").tofile(folder / "picture")
    nodes.astype("<f8").tofile(folder / "map")
    shape = [size, size, 4, folder / "map", nodes.shape[2], nodes.shape[1], 0, spacing, direction, "cubic", REPEATS]
    command = [example, folder / "picture", *shape, folder / "out"]
    lines = subprocess.run([str(word) for word in command], check=True, capture_output=True, text=True).stdout.split()
    return statistics.median(map(float, lines)), np.fromfile(folder / "out", "<f4").reshape(planes.shape)


def remap(planes, positions):
    cv2.setNumThreads(1)
    picture = np.ascontiguousarray(planes.transpose(1, 2, 0))
    x, y = (positions - 0.5).astype(np.float32)
    out, seconds = np.ones_like(picture), []
    for _ in range(REPEATS):
        start = time.process_time()
        cv2.remap(picture, x, y, cv2.INTER_CUBIC, dst=out, borderMode=cv2.BORDER_CONSTANT)
        seconds.append(time.process_time() - start)
    return statistics.median(seconds), out.transpose(2, 0, 1)


def st_warp(planes, positions):
    size = planes.shape[1]
    image = oiio.ImageBuf(np.ascontiguousarray(planes.transpose(1, 2, 0)))
    coordinates = oiio.ImageBuf((positions / size).transpose(1, 2, 0).astype(np.float32).copy())
    start = time.process_time()
    out = oiio.ImageBufAlgo.st_warp(image, coordinates, "catmull-rom", 0.0, 0, 1, False, False, oiio.ROI(), 1)
    return time.process_time() - start, out.has_error


def main(example, size):
    random = np.random.default_rng(1)
    y, x = np.mgrid[0:size, 0:size]
    waves = [0.5 + 0.3 * np.sin(0.05 * (k + 1) * x) * np.cos(0.04 * (4 - k) * y) for k in range(4)]
    planes = (np.stack(waves) + 0.1 * random.random((4, size, size))).astype(np.float32)
    rows, million = slice(size // 3, size // 3 + 64), size * size / 1e6
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        for name, function, spacing in [("smooth", smooth, 1), ("swirl", swirl, 1), ("cells", smooth, 5)]:
            nodes = lattice(size, spacing, function)
            direction = "backward" if spacing == 1 else "forward"
            seconds, drawn = ours(example, folder, planes, nodes, spacing, direction)
            positions = means(nodes) if spacing == 1 else inverse(size, function)
            peer, peer_drawn = remap(planes, positions)
            if spacing == 1:
                good = psnr(drawn[:, rows], exact(planes, positions, -0.5, rows))
                other = psnr(peer_drawn[:, rows], exact(planes, positions, -0.75, rows))
                print(f"{name}: PSNR {good:.1f} dB, remap {other:.1f} dB, target: 20 dB more: {good - other:.1f}")
            rate, peer_rate = million / seconds, million / peer
            print(f"{name}: {rate:.1f} Mpix/s, remap {peer_rate:.1f}, ratio {rate / peer_rate:.2f}, target {TARGET}")
            if name == "smooth":
                other_rate = million / st_warp(planes, positions)[0]
                print(f"{name}: st_warp catmull-rom {other_rate:.1f} Mpix/s, ratio {rate / other_rate:.1f}")


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 4096)
