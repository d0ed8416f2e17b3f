"""Detail beside EbSynth and the texture-synthesis crate: 256 and 512 px, one thread, processor time, medians.

A picture is blurred by a Gaussian of 1.5 px and is to get its detail back from another part: at 256 px the upper left
quarter shows the detail and the lower right quarter is blurred, at 512 px the whole picture and its mirror image. Told are

  energy    in .25 to .5 cycles/px, over the truth's (luma, Hann window): to be within .75 and 1.25
  residual  root mean square of blur(result) - blurred picture, of 255: to be at most 5
  seconds   of which the similar sets, and all; to be at most 1/10 of EbSynth's and 1/30 of texture-synthesis's

The peers, told the same by guides (blurred example, blurred picture):

  texture-synthesis 0.8.3   cargo install --locked texture-synthesis-cli
  EbSynth                   g++ -O3 -fopenmp -DNDEBUG -Iinclude -std=c++11 src/ebsynth.cpp src/ebsynth_cpu.cpp \\
                            src/ebsynth_nocuda.cpp -o bin/ebsynth   (github.com/jamriska/ebsynth; in no registry)

A peer that is not given is replaced by what it took on one machine before: EBSYNTH and SYNTHESIS below.

Usage: bench_detail.py EXAMPLE PICTURES [SYNTHESIS [EBSYNTH]]
EXAMPLE: the release build of tests/examples/detail.rs; PICTURES: a folder with gravel.png, brick.png and ihc.png, 512 px
(scikit-image's data); SYNTHESIS, EBSYNTH: the peers' programs, - for none.
"""

import pathlib
import resource
import statistics
import subprocess
import sys
import tempfile

import cv2
import numpy as np

REPEATS, DEVIATION, PICTURES = 5, 1.5, ("gravel", "brick", "ihc")
EBSYNTH, SYNTHESIS = {256: 3.3, 512: 15.9}, {256: 11.8, 512: 51.0}


def blur(picture):
    return cv2.GaussianBlur(picture, (0, 0), DEVIATION, borderType=cv2.BORDER_REFLECT)


def case(picture, size):
    """What shows the detail, and the truth."""
    return (picture[:256, :256], picture[256:, 256:]) if size == 256 else (picture, picture[:, ::-1])


def energy(picture):
    """Of luma in .25 to .5 cycles/px."""
    luma = picture @ np.array([0.0722, 0.7152, 0.2126])
    luma = (luma - luma.mean()) * np.hanning(luma.shape[0])[:, None] * np.hanning(luma.shape[1])
    across, down = np.meshgrid(*(np.fft.fftfreq(n) for n in luma.shape[::-1]))
    frequency = np.hypot(across, down)
    return (np.abs(np.fft.fft2(luma)) ** 2)[(frequency >= 0.25) & (frequency < 0.5)].sum()


def told(name, size, result, truth, seconds, more=""):
    residual = np.sqrt(np.mean((blur(result) - blur(truth)) ** 2))
    share = energy(result) / energy(truth)
    print(f"{name:18} {size} energy {share:5.2f}  residual {residual:5.2f}  seconds {seconds:7.3f} {more}", flush=True)
    return 0.75 <= share <= 1.25 and residual <= 5


def processor_seconds(command):
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    output = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, output


def planes(path, picture):
    """B, G, R of 255 to R, G, B of 1."""
    (picture[:, :, ::-1].transpose(2, 0, 1) / 255).astype("<f4").tofile(path)


def ours(example, folder, training, truth):
    size = [str(n) for n in (truth.shape[1], truth.shape[0])]
    planes(folder / "training", training)
    planes(folder / "blurred", blur(truth))
    parts = [folder / "training", *size, folder / "blurred", *size, DEVIATION, "coherent", 1, REPEATS, folder / "out"]
    _, output = processor_seconds([example, *map(str, parts)])
    seconds = [[float(part) for part in line.split()] for line in output.splitlines()]
    result = np.fromfile(folder / "out", "<f4").reshape(3, *truth.shape[:2]).transpose(1, 2, 0)[:, :, ::-1]
    sets, all_of_it = statistics.median(s for s, _ in seconds), statistics.median(map(sum, seconds))
    return 255.0 * result, all_of_it, sets


def peer(command, folder, training, truth):
    """The result of a program that reads the example, its blurred form and the blurred picture, and its seconds."""
    pictures = {"example": training, "from": blur(training), "to": blur(truth)}
    for name, picture in pictures.items():
        cv2.imwrite(str(folder / f"{name}.png"), picture.round().clip(0, 255).astype(np.uint8))
    seconds, _ = processor_seconds(command)
    return cv2.imread(str(folder / "peer.png")).astype(float), seconds


def main():
    example, pictures, *peers = sys.argv[1:]
    synthesis, ebsynth = (None if path == "-" else path for path in (peers + ["-", "-"])[:2])
    met = True
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        files = {key: str(folder / f"{key}.png") for key in ("example", "from", "to", "peer")}
        for size in (256, 512):
            guided = [files["example"], "--guides", files["from"], "--target-guide", files["to"]]
            told_to = ["-t", "1", "--seed", "1", "--out-size", str(size), "--out", files["peer"], "generate"]
            commands = {
                "texture-synthesis": synthesis and [synthesis, *told_to, *guided],
                "EbSynth": ebsynth and [ebsynth, "-style", files["example"], "-guide", files["from"], files["to"],
                                        "-output", files["peer"], "-backend", "cpu"],
            }
            for picture in PICTURES:
                whole = cv2.imread(str(pathlib.Path(pictures) / f"{picture}.png")).astype(float)
                training, truth = case(whole, size)
                result, seconds, sets = ours(example, folder, training, truth)
                met &= told(f"{picture} Detail", size, result, truth, seconds, f"(sets {sets:.3f})")
                for peer_name, before, factor in (("EbSynth", EBSYNTH, 10), ("texture-synthesis", SYNTHESIS, 30)):
                    took, note = before[size], "as measured before"
                    if commands[peer_name]:
                        theirs, took = peer(commands[peer_name], folder, training, truth)
                        told(peer_name, size, theirs, truth, took)
                        note = "now"
                    print(f"    1/{took / seconds:.0f} of {peer_name}'s, {note}; the target is 1/{factor}", flush=True)
                    met &= seconds <= took / factor
    print("all targets met" if met else "a target was missed")


main()
