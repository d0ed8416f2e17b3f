"""The grid Poisson solver beside CHOLMOD, on the same matrix, in one run.

Prints one table: CPU seconds of one thread (medians), memory, ratios and targets, and the largest distance to the
direct solution in double precision. Needs a C compiler; where CHOLMOD's header is missing it is installed with apt-get.
Usage: bench_solver.py SOLVER [SIZE...], SOLVER the built example `solver`.
"""

import json
import os
import pathlib
import subprocess
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parent
HEADER = pathlib.Path("/usr/include/suitesparse/cholmod.h")
ENVIRONMENT = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "RAYON_NUM_THREADS": "1"}
RUNS = {200: 9, 500: 5, 1000: 3}
METHODS = [(ordering, kind) for ordering in ("AMD", "METIS", "NESDIS") for kind in ("SUPERNODAL", "SIMPLICIAL")]

# Ours over the best of CHOLMOD's: factor, factor with a first solve to 1e-3, solve to 1e-3, solve to 1e-2, memory.
TARGETS = {
    200: {"factor": 1 / 2, "solve_1e-3": 2.0},
    1000: {"first": 1 / 15, "solve_1e-3": 0.8, "solve_1e-2": 0.5, "bytes": 1 / 6},
}


def run(*command):
    return json.loads(subprocess.run([str(part) for part in command], env=ENVIRONMENT, check=True, stdout=subprocess.PIPE).stdout)


def compiled(folder):
    if not HEADER.exists():
        subprocess.run(["apt-get", "install", "-y", "libsuitesparse-dev"], check=True, stdout=subprocess.DEVNULL)
    driver = folder / "bench_solver"
    flags = ["-O2", f"-I{HEADER.parent}", "-o", driver, HERE / "bench_solver.c", "-lcholmod"]
    subprocess.run(["cc", *flags], check=True)
    return driver


def peers(driver, size, system):
    """Figures of every method; the simplicial ones take minutes on large lattices and are left out there."""
    methods = [method for method in METHODS if size <= 300 or method[1] == "SUPERNODAL"]
    found = {method: run(driver, size, system, RUNS.get(size, 3), *method) for method in methods}
    for figures in found.values():
        figures["first"] = figures["factor"] + figures["solve"]
    return found


def report(size, ours, found):
    targets = TARGETS.get(size, {})
    ours["first"] = ours["factor"] + ours["solve_1e-3"]
    pairs = [("factor", "factor"), ("first", "first"), ("solve_1e-2", "solve"), ("solve_1e-3", "solve"), ("solve_1e-6", "solve"), ("peak", "peak")]
    for name, key in pairs:
        method, best = min(((method, figures[key]) for method, figures in found.items()), key=lambda pair: pair[1])
        ratio = ours[name] / best
        target = targets.get("bytes" if name == "peak" else name)
        verdict = "" if target is None else f"{target:.3f} " + ("met" if ratio <= target else "missed")
        scale, unit = (1e6, "MB") if name == "peak" else (1e-3, "ms")
        peer = f"{best / scale:.2f} {unit} {' '.join(method).lower()}"
        print(f"{size:5} {ours['backend']:10} {name:11} {ours[name] / scale:9.2f} {unit} {peer:32} {ratio:7.3f}  {verdict}")
    distances = ", ".join(f"{name[9:]}: {value:.1e}" for name, value in ours.items() if name.startswith("distance"))
    print(f"{size:5} {ours['backend']:10} distance in cells to the direct solution, by tolerance: {distances}")


def main():
    solver, sizes = sys.argv[1], [int(size) for size in sys.argv[2:]] or [200, 500, 1000]
    print(f"{'size':5} {'ours by':10} {'figure':11} {'ours':12} {'best of CHOLMOD':32} {'ratio':7}  target")
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        driver = compiled(folder)
        for size in sizes:
            system = folder / "system"
            report(size, run(solver, size, system, RUNS.get(size, 3)), peers(driver, size, system))


if __name__ == "__main__":
    main()
