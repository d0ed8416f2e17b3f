"""The feature-aware solve against the literal least squares of the paper (Gal, Sorkine, Cohen-Or 2006, equations 1 to 7).

The system is put together here edge by edge, with pseudo-inverses and singular value decompositions as the paper has
them, and solved by SciPy's sparse LU in double precision. The result must agree within 1e-6 cell.
Usage: check_feature_warp.py WARPLOOM
"""

import json
import pathlib
import subprocess
import sys
import tempfile

import numpy as np
import OpenImageIO as oiio
import scipy.sparse as sp
from scipy.sparse.linalg import splu

GRAPHS = pathlib.Path(__file__).resolve().parents[2] / "graphs"
WEIGHT, RADIUS = 10.0, 2.0


def run(warploom, folder, mode):
    dumps = {name: folder / name for name in ("bend.json", "keep.json", "parts.exr")}
    flags = [f"--dump={path.stem}={path}" for path in dumps.values()]
    command = [warploom, "run", GRAPHS / "feature_warp.ron", "--no-cache", "--progress", "none", "--target", "keep"]
    subprocess.run([*command, "--set", f"keep.mode={mode}", *flags], check=True, stdout=subprocess.DEVNULL)
    labels = oiio.ImageBuf(str(dumps["parts.exr"])).get_pixels(oiio.UINT32)[:, :, 0]
    return json.loads(dumps["bend.json"].read_text()), json.loads(dumps["keep.json"].read_text()), labels


def cell_labels(labels, warp):
    """Lowest label whose pixel centre a half-open cell holds."""
    columns, rows = (n - 1 for n in warp["nodes"])
    cells = np.zeros((rows, columns), dtype=np.int64)
    for y, x in zip(*np.nonzero(labels)):
        c = int(np.floor((x + 0.5 - warp["origin"][0]) / warp["spacing"][0]))
        r = int(np.floor((y + 0.5 - warp["origin"][1]) / warp["spacing"][1]))
        if 0 <= c < columns and 0 <= r < rows:
            label = int(labels[y, x])
            cells[r, c] = min(cells[r, c], label) if cells[r, c] else label
    return cells


def nearest_features(cells):
    """Per cell: distance of its centre to the nearest feature cell, as a filled square, and that one's label."""
    distance = np.full(cells.shape, np.inf)
    nearest = np.zeros(cells.shape, dtype=np.int64)
    reach = int(np.ceil(RADIUS)) + 1
    for r in range(cells.shape[0]):
        for c in range(cells.shape[1]):
            if cells[r, c]:
                distance[r, c], nearest[r, c] = 0.0, cells[r, c]
                continue
            for fr in range(max(0, r - reach), min(cells.shape[0], r + reach + 1)):
                for fc in range(max(0, c - reach), min(cells.shape[1], c + reach + 1)):
                    if cells[fr, fc]:
                        d = np.hypot(max(abs(fr - r) - 0.5, 0), max(abs(fc - c) - 0.5, 0))
                        if (d, cells[fr, fc]) < (distance[r, c], nearest[r, c] or 10**9):
                            distance[r, c], nearest[r, c] = d, cells[fr, fc]
    return distance, nearest


def solve(warp, cells, mode):
    columns, rows = warp["nodes"]
    target = np.stack([warp["x"], warp["y"]], axis=1).reshape(rows, columns, 2)
    hx, hy = warp["spacing"]
    rest = np.stack(np.meshgrid(np.arange(columns) * hx, np.arange(rows) * hy), axis=2)
    distance, nearest = nearest_features(cells)
    corners = lambda r, c: [(r, c), (r, c + 1), (r + 1, c + 1), (r + 1, c)]

    rotations, smaller = {}, {}
    for r in range(rows - 1):
        for c in range(columns - 1):
            if distance[r, c] < max(RADIUS, 1e-9):
                u = np.array([rest[q] for q in corners(r, c)]).T
                w = np.array([target[q] for q in corners(r, c)]).T
                t = (w - w.mean(1, keepdims=True)) @ np.linalg.pinv(u - u.mean(1, keepdims=True))
                left, sigma, right = np.linalg.svd(t)
                proper = np.diag([1.0, np.linalg.det(left @ right)])
                rotations[r, c] = left @ proper @ right
                smaller[r, c] = max(sigma[1] * np.linalg.det(left @ right), 0.0)
    scale = {
        label: np.mean([smaller[q] for q in zip(*np.nonzero(cells == label))]) if mode == "Similarity" else 1.0
        for label in np.unique(cells[cells > 0])
    }

    i, j, v, b = [], [], [], []
    for r in range(rows - 1):
        for c in range(columns - 1):
            d = distance[r, c]
            feature = d < RADIUS
            f = 2 * (d / RADIUS) ** 3 - 3 * (d / RADIUS) ** 2 + 1 if feature else 0.0
            w = WEIGHT * f + 1 - f
            ring = corners(r, c)
            for p, q in zip(ring, ring[1:] + ring[:1]):
                edge = target[q] - target[p]
                if feature:
                    edge = scale[nearest[r, c]] * rotations[r, c] @ (rest[q] - rest[p])
                row = len(b)
                i += [row, row]
                j += [q[0] * columns + q[1], p[0] * columns + p[1]]
                v += [w, -w]
                b.append(w * edge)
    a = sp.csr_matrix((v, (i, j)), shape=(len(b), rows * columns))
    b = np.array(b)
    inner = np.zeros((rows, columns), dtype=bool)
    inner[1:-1, 1:-1] = True
    inner = inner.ravel()
    flat = target.reshape(-1, 2)
    free, fixed = a[:, inner], a[:, ~inner]
    solved = flat.copy()
    solved[inner] = splu((free.T @ free).tocsc()).solve(free.T @ (b - fixed @ flat[~inner]))
    return solved


def main():
    warploom = pathlib.Path(sys.argv[1]).resolve()
    for mode in ("Similarity", "Rigid"):
        with tempfile.TemporaryDirectory() as folder:
            warp, kept, labels = run(warploom, pathlib.Path(folder), mode)
        expected = solve(warp, cell_labels(labels, warp), mode)
        found = np.stack([kept["x"], kept["y"]], axis=1)
        worst = np.abs(found - expected).max() / min(warp["spacing"])
        print(f"{mode}: {warp['nodes'][0]} x {warp['nodes'][1]} nodes, largest difference {worst:.2e} cell")
        assert worst <= 1e-6, "more than 1e-6 cell from the direct solution"


main()
