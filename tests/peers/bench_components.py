"""Components beside OpenCV: 4096 x 4096, labels, areas, boxes and centroids, 2 threads each, medians of turns taken.

Pictures: gravel, scikit-image's photograph (512 x 512), tiled by mirroring and thresholded at its median; noise, each
pixel set with a chance of one half. Ours reads f32 coverage and writes u32, OpenCV reads u8 and writes i32; each gets
what it wants beforehand. The labels go into the memory of the run before, as in the engine; with fresh memory, for
comparison, the system's clearing of pages is measured too. Turns alternate: ours, OpenCV, ours, ... Beside the time that
passed stands the time of the processors, which other work on the machine disturbs less.

The labels must cut the picture into the same components; areas and boxes are compared exactly, centroids to 1e-9 of
themselves. Exits with 1 where they differ.

Usage: bench_components.py EXAMPLE GRAVEL [REPEATS]      (EXAMPLE: the release build of tests/examples/components.rs)
"""

import pathlib
import statistics
import subprocess
import sys
import tempfile
import time

import cv2
import numpy as np

SIZE, TARGET = 4096, 1.5


def gravel(path):
    picture = cv2.imread(path, cv2.IMREAD_GRAYSCALE)
    pair = np.hstack([picture, picture[:, ::-1]])
    quad = np.vstack([pair, pair[::-1]])
    tiled = np.tile(quad, -(-SIZE // np.array(quad.shape)))[:SIZE, :SIZE]
    return np.uint8(tiled > np.median(picture))


def noise():
    return np.random.default_rng(5).integers(0, 2, (SIZE, SIZE), np.uint8)


def same(ours, table, theirs, stats, centroids):
    """Whether both describe the same components; OpenCV's labels need not come in raster order."""
    if len(table) != len(stats) - 1:
        return False
    # Each of our labels met one of theirs, and by their count each of theirs: then one map takes ours to theirs.
    _, first = np.unique(ours, return_index=True)
    if ours.ravel()[first[0]] != 0:
        return False
    theirs_of_ours = theirs.ravel()[first]
    if not (theirs_of_ours[ours] == theirs).all():
        return False
    stats, centroids = stats[theirs_of_ours[1:]], centroids[theirs_of_ours[1:]]
    left, top, width, height, area = stats.T
    exact = np.stack([np.arange(1, len(table) + 1), left, top, left + width, top + height, area], 1)
    # OpenCV's centroids count from the centre of the first pixel.
    return (table[:, :6] == exact).all() and np.allclose(table[:, 6:], centroids + 0.5, rtol=1e-9, atol=0)


def median(taken, part):
    return statistics.median(times[part] for times in taken)


def compare(example, folder, name, mask, connectivity, repeats):
    mask.tofile(folder / "mask")
    command = [example, folder / "mask", str(SIZE), str(connectivity), folder / "out"]
    ours = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    labels = np.empty(mask.shape, np.int32)
    times = {(who, memory): [] for memory in ("recycled", "fresh") for who in ("ours", "OpenCV")}
    for turn in range(repeats + 1):
        for memory in ("recycled", "fresh"):
            print(memory, file=ours.stdin, flush=True)
            ours_took = [float(part) for part in ours.stdout.readline().split()]
            start, processor = time.perf_counter(), time.process_time()
            into = (labels,) if memory == "recycled" else ()
            _, found, stats, centroids = cv2.connectedComponentsWithStats(mask, *into, connectivity=connectivity)
            theirs_took = [time.perf_counter() - start, time.process_time() - processor]
            labels = found if memory == "recycled" else labels
            del found
            # The first turn warms up.
            if turn > 0:
                times["ours", memory].append(ours_took)
                times["OpenCV", memory].append(theirs_took)
    ours.communicate()
    found = np.fromfile(folder / "out.labels", "<u4").reshape(mask.shape)
    table = np.fromfile(folder / "out.table", "<f8").reshape(-1, 8)
    print(f"{name}, {connectivity}-connected, {len(table)} components")
    for memory in ("recycled", "fresh"):
        passed, busy = ([median(times[who, memory], part) for who in ("ours", "OpenCV")] for part in (0, 1))
        ratio = passed[1] / passed[0]
        verdict = f", the target of {TARGET} is {'met' if ratio >= TARGET else 'missed'}" if memory == "recycled" else ""
        print(
            f"  {memory:<8}  ours {mask.size / passed[0] / 1e6:.0f} Mpix/s, OpenCV {mask.size / passed[1] / 1e6:.0f}: "
            f"{ratio:.2f} times its rate{verdict}; processor {1e3 * busy[0]:.0f} ms and {1e3 * busy[1]:.0f} ms: "
            f"{busy[1] / busy[0]:.2f} times"
        )
    equal = same(found, table, labels, stats, centroids)
    if not equal:
        print("  the components differ")
    return equal


def main():
    example, path = sys.argv[1:3]
    repeats = int(sys.argv[3]) if len(sys.argv) > 3 else 21
    cv2.setNumThreads(2)
    pictures = {"gravel": gravel(path), "noise": noise()}
    with tempfile.TemporaryDirectory() as name:
        cases = [(picture, ways) for picture in pictures for ways in (8, 4)]
        equal = [compare(example, pathlib.Path(name), p, pictures[p], ways, repeats) for p, ways in cases]
    sys.exit(0 if all(equal) else 1)


main()
