"""Shrinking beside OpenImageIO's st_warp: RGBA f32, one thread, processor time, medians; `ewa` against catmull-rom.

A picture of discs, lines, noise and a zone plate is shrunk to 1/1, 1/2, 1/4 and 1/8, and unevenly and turned; then side by
side, mirrored again and again, until the result is as large as the picture, so that halving it counts less. The PSNR is that
to the mean, in f64, of 16 x 16 places in each pixel, the picture between samples being Keys' cubic with a = -1/2.
Usage: bench_ewa.py EXAMPLE [SIZE]      (EXAMPLE: the release build of tests/examples/resample.rs)
"""

import pathlib
import statistics
import subprocess
import sys
import tempfile
import time

import numpy as np
import OpenImageIO as oiio

from bench_resample import exact, psnr

REPEATS, TARGET, PROBES, PATCH = 5, 10.0, 16, 96
# Name, shrink along x and y, turn in degrees; those with a target first.
CASES = [(f"{n}x", n, n, 0) for n in (1, 2, 4, 8)]
CASES += [("4x 1x", 4, 1, 0), ("4x 1x turned 30", 4, 1, 30), ("3x turned 20", 3, 3, 20), ("8x 2x turned 45", 8, 2, 45)]


def picture(size):
    random = np.random.default_rng(1)
    y, x = np.mgrid[0:size, 0:size] + 0.5
    spectrum = np.fft.fftfreq(size)
    distance = np.hypot(spectrum[:, None], spectrum)
    distance[0, 0] = 1.0
    clouds = np.fft.ifft2(np.fft.fft2(random.standard_normal((size, size))) / distance).real
    discs = np.zeros((size, size))
    for _ in range(300):
        centre, radius, value = random.random(2) * size, 3 + random.random() * size / 20, random.random()
        discs[np.hypot(x - centre[0], y - centre[1]) < radius] = value
    for _ in range(60):
        angle, offset, value = random.random() * np.pi, (random.random() - 0.5) * size, random.random()
        across = (x - size / 2) * np.cos(angle) + (y - size / 2) * np.sin(angle)
        discs[np.abs(across - offset) < 1.0] = value
    zones = 0.5 + 0.5 * np.cos(np.pi * ((x - size / 2) ** 2 + (y - size / 2) ** 2) / size)
    clouds = 0.5 + 0.2 * clouds / clouds.std()
    return np.stack([discs, clouds, zones, 0.5 * discs + 0.5 * clouds]).astype(np.float32)


def affine(across, down, degrees, size, out):
    """Source by destination: the matrix, and what is added; the middles of both meet, but for part of a pixel."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    matrix = np.array([[c, -s], [s, c]]) @ np.diag([across, down])
    return matrix, size / 2 + np.array([0.3, 0.2]) - matrix @ np.array([out / 2, out / 2])


def reference(planes, matrix, offset, patch):
    """The patch's pixels by the mean over many places in each."""
    y, x = np.mgrid[patch, patch].astype(float)
    total = 0.0
    for v in (np.arange(PROBES) + 0.5) / PROBES:
        for u in (np.arange(PROBES) + 0.5) / PROBES:
            at = np.tensordot(matrix, np.stack([x + u, y + v]), 1) + offset[:, None, None]
            total = total + exact(planes, at, -0.5, slice(None))
    return total / PROBES**2


def ours(example, folder, planes, matrix, offset, out):
    size = planes.shape[1]
    planes.astype("<f4").tofile(folder / "picture")
    at = np.arange(2) * float(out)
    corners = np.stack(np.broadcast_arrays(at[None, :], at[:, None]))
    (np.tensordot(matrix, corners, 1) + offset[:, None, None]).astype("<f8").tofile(folder / "map")
    return timed(example, folder, size, 2, out, out)


def timed(example, folder, size, nodes, spacing, out):
    shape = [size, size, 4, folder / "map", nodes, nodes, 0, spacing, "backward", "ewa", REPEATS, folder / "out", out, out]
    command = [str(word) for word in [example, folder / "picture", *shape]]
    lines = subprocess.run(command, check=True, capture_output=True, text=True).stdout.split()
    return statistics.median(map(float, lines)), np.fromfile(folder / "out", "<f4").reshape(4, out, out)


def mirrored(example, folder, planes, shrink):
    """Seconds of both for the picture side by side; the map's cells are the copies."""
    size = planes.shape[1]
    at = np.where(np.arange(shrink + 1) % 2, float(size), 0.0)
    np.stack(np.broadcast_arrays(at[None, :], at[:, None])).astype("<f8").tofile(folder / "map")
    seconds, _ = timed(example, folder, size, shrink + 1, size / shrink, size)
    place = np.abs((shrink * (np.arange(size) + 0.5) + size) % (2 * size) - size)
    return seconds, warped(planes, np.stack(np.meshgrid(place, place)))[0]


def st_warp(planes, matrix, offset, out):
    centers = np.stack(np.meshgrid(np.arange(out) + 0.5, np.arange(out) + 0.5))
    return warped(planes, np.tensordot(matrix, centers, 1) + offset[:, None, None])


def warped(planes, positions):
    size = planes.shape[1]
    image = oiio.ImageBuf(np.ascontiguousarray(planes.transpose(1, 2, 0)))
    coordinates = oiio.ImageBuf((positions / size).transpose(1, 2, 0).astype(np.float32).copy())
    seconds = []
    while len(seconds) < 3 and sum(seconds) < 10:
        start = time.process_time()
        drawn = oiio.ImageBufAlgo.st_warp(image, coordinates, "catmull-rom", 0.0, 0, 1, False, False, oiio.ROI(), 1)
        seconds.append(time.process_time() - start)
    assert not drawn.has_error, drawn.geterror()
    return statistics.median(seconds), drawn.get_pixels(oiio.FLOAT).transpose(2, 0, 1)


def main(example, size):
    planes = picture(size)
    with tempfile.TemporaryDirectory() as folder:
        for name, across, down, degrees in CASES:
            out = size // max(across, down) if degrees == 0 else size // (2 * max(across, down))
            matrix, offset = affine(across, down, degrees, size, out)
            seconds, drawn = ours(example, pathlib.Path(folder), planes, matrix, offset, out)
            peer, peer_drawn = st_warp(planes, matrix, offset, out)
            patch = slice(max(0, out // 2 - PATCH // 2), min(out, out // 2 + PATCH // 2))
            expected = reference(planes, matrix, offset, patch)
            good, other = [psnr(found[:, patch, patch], expected) for found in (drawn, peer_drawn)]
            rate, peer_rate = out * out / 1e6 / seconds, out * out / 1e6 / peer
            print(f"{name}: {rate:.2f} Mpix/s, st_warp {peer_rate:.3f}, ratio {rate / peer_rate:.1f}, target {TARGET}; "
                  f"PSNR {good:.1f} dB, st_warp {other:.1f}", flush=True)
        for shrink in (1, 2, 4, 8):
            seconds, peer = mirrored(example, pathlib.Path(folder), planes, shrink)
            rate, peer_rate = size * size / 1e6 / seconds, size * size / 1e6 / peer
            print(f"{shrink}x side by side: {rate:.2f} Mpix/s, st_warp {peer_rate:.3f}, ratio {rate / peer_rate:.1f}, "
                  f"target {TARGET}", flush=True)


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 2048)
