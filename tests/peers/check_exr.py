"""Identity graphs over EXR files against OpenImageIO: pixels to the bit, windows, channels, types, attributes.

Usage: check_exr.py WARPLOOM. Reads the samples of openexr-images if they lie in ../shared/data beside the checkout.
"""

import pathlib
import subprocess
import sys
import tempfile

import numpy as np
import OpenImageIO as oiio

SAMPLES = pathlib.Path(__file__).resolve().parents[3] / "shared" / "data" / "openexr-images"
STORAGE = {"compression", "oiio:subimages", "oiio:subimagename", "openexr:chunkCount", "openexr:lineOrder", "tileoffset"}


def made(folder):
    """Files of every type, compression and sort of window."""
    random = np.random.default_rng(1)
    windows = [((0, 0), (0, 0, 40, 24)), ((-7, 5), (0, 0, 40, 24)), ((100, 50), (90, 40, 60, 60)), ((30, 30), (0, 0, 8, 8))]
    for number, ((x, y), (fx, fy, fw, fh)) in enumerate(windows):
        for kind in ("half", "float", "uint32"):
            for compression in ("none", "rle", "zips", "zip", "piz"):
                spec = oiio.ImageSpec(37, 19, 3, kind)
                spec.x, spec.y = x, y
                spec.full_x, spec.full_y, spec.full_width, spec.full_height = fx, fy, fw, fh
                spec.channelnames = ("R", "G", "diffuse.left.B")
                spec["compression"] = compression
                spec["PixelAspectRatio"] = 2.0
                spec["shot"] = "sh010"
                spec["lens"] = 35.5
                path = folder / f"made_{number}_{kind}_{compression}.exr"
                out = oiio.ImageOutput.create(str(path))
                pixels = random.integers(0, 2**32, (19, 37, 3), dtype=np.uint32)
                if kind != "uint32":
                    pixels = (random.standard_normal((19, 37, 3)) * 100).astype(np.float32)
                assert out.open(str(path), spec) and out.write_image(pixels), out.geterror()
                out.close()
                yield path


def parts(path):
    image = oiio.ImageInput.open(str(path))
    assert image, f"{path}: {oiio.geterror()}"
    number = 0
    while image.seek_subimage(number, 0):
        spec = image.spec()
        kind = oiio.UINT32 if spec.format == oiio.TypeDesc("uint") else oiio.FLOAT
        pixels = image.read_image(number, 0, 0, spec.nchannels, kind)
        assert pixels is not None, f"{path}: {image.geterror()}"
        yield spec, pixels
        number += 1


def attributes(spec):
    return {a.name: a.value for a in spec.extra_attribs if a.name not in STORAGE and not a.name.startswith("oiio:")}


def same(before, after):
    pairs = list(zip(parts(before), parts(after), strict=True))
    for (old, a), (new, b) in pairs:
        for field in ("x", "y", "width", "height", "full_x", "full_y", "full_width", "full_height"):
            assert getattr(old, field) == getattr(new, field), f"{field}: {getattr(old, field)}, {getattr(new, field)}"
        # OpenEXR keeps channels by name; the order that is shown is the reader's.
        assert old.channelnames == new.channelnames, f"{old.channelnames}, {new.channelnames}"
        assert [str(f) for f in old.channelformats] == [str(f) for f in new.channelformats] and old.format == new.format
        assert attributes(old).items() <= attributes(new).items(), f"{attributes(old)}, {attributes(new)}"
        assert np.array_equal(a, b, equal_nan=a.dtype.kind == "f"), "pixels differ"


def main():
    warploom = pathlib.Path(sys.argv[1]).resolve()
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        files = list(made(folder))
        files += sorted(p for p in SAMPLES.glob("**/*.exr") if "Damaged" not in p.parts)
        graph = folder / "identity.ron"
        same_count, refused = 0, []
        for file in files:
            graph.write_text(
                f'Graph(version: 1, nodes: {{"in": Load(path: "{file}"), "out": Save(image: "in", path: "out.exr")}})'
            )
            command = [warploom, "run", graph, "--no-cache", "--progress", "none"]
            run = subprocess.run(command, capture_output=True, text=True)
            if run.returncode == 4:
                refused.append(file.name)
                continue
            assert run.returncode == 0, f"{file}: exit {run.returncode}\n{run.stderr}"
            try:
                same(file, folder / "out.exr")
            except AssertionError as error:
                raise AssertionError(f"{file}: {error}") from error
            same_count += 1
        print(f"{same_count} files come and go unchanged; refused as unsupported: {', '.join(refused) or 'none'}")


main()
