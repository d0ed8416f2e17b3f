"""Similarity beside OpenCV: 512 x 512 RGB, diameter 5, levels 0 and 1, one thread, processor time, medians.

OpenCV: pyrDown, matchTemplate with TM_SQDIFF and a disc for a mask, the levels added up, the opacity. Ours: from the same
codes, the guide, the distances and the opacity; a new point needs the last two alone. The distances are compared to the
integer. Then a texture is warped, another point selected each time.

Usage: bench_similarity.py EXAMPLE      (EXAMPLE: the release build of tests/examples/similar.rs)
"""

import pathlib
import statistics
import subprocess
import sys
import tempfile
import time

import cv2
import numpy as np

SIZE, REPEATS, TARGET, RATE = 512, 31, 25, 60
DISC = (4 * (np.arange(-2, 3)[:, None] ** 2 + np.arange(-2, 3)[None, :] ** 2) <= 25).astype(np.uint8)


def texture():
    """Blobs of some sizes, coloured."""
    random = np.random.default_rng(3)
    layers = [cv2.GaussianBlur(random.standard_normal((SIZE, SIZE, 3)), (0, 0), s) * s for s in (1.0, 2.5, 6.0)]
    picture = sum(layers)
    return np.clip(128 + 45 * picture / picture.std(), 0, 255).astype(np.uint8)


def opencv(picture, point):
    total = np.zeros((SIZE, SIZE), np.float32)
    mask = np.repeat(DISC[:, :, None], 3, 2)
    for level in (0, 1):
        if level == 1:
            picture = cv2.pyrDown(picture)
        padded = cv2.copyMakeBorder(picture, 2, 2, 2, 2, cv2.BORDER_REFLECT_101)
        x, y = point[0] >> level, point[1] >> level
        found = cv2.matchTemplate(padded, padded[y : y + 5, x : x + 5], cv2.TM_SQDIFF, mask=mask)
        total += found if level == 0 else cv2.resize(found, (SIZE, SIZE), interpolation=cv2.INTER_NEAREST)
    return total, 0.75 * np.maximum(0, 1 - total / np.float32(8e5))


def main():
    example = sys.argv[1]
    cv2.setNumThreads(1)
    picture, point = texture(), (SIZE // 3, SIZE // 4)
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        picture[:, :, ::-1].transpose(2, 0, 1).tofile(folder / "planes")
        theirs = []
        for _ in range(REPEATS):
            start = time.process_time()
            total, _ = opencv(picture, point)
            theirs.append(time.process_time() - start)
        command = [example, "map", folder / "planes", str(SIZE), str(REPEATS), folder / "out"]
        output = subprocess.run(command, check=True, capture_output=True, text=True).stdout
        rows = [[1e3 * float(part) for part in line.split()] for line in output.splitlines()]
        codes, guide, distances, opacity = (statistics.median(column) for column in zip(*rows))
        found = np.fromfile(folder / "out", "<f4").reshape(SIZE, SIZE)
        assert (found == np.rint(total)).all(), "the distances differ"
        cv, all_of_it = 1e3 * statistics.median(theirs), guide + distances + opacity
        print(f"OpenCV {cv:.2f} ms; ours {all_of_it:.2f} ms: guide {guide:.2f}, distances {distances:.2f}, opacity {opacity:.2f}")
        print(f"{cv / all_of_it:.0f} times OpenCV's rate, {cv / (distances + opacity):.0f} times for a new point; the target is {TARGET}")
        print(f"besides, codes of scene-linear f32: {codes:.2f} ms")
        cv2.imwrite(str(folder / "picture.png"), picture)
        print(f"the target of the loop is {RATE} per second:")
        subprocess.run([example, "loop", folder / "picture.png", "100"], check=True)


main()
