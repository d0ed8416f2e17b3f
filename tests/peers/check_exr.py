"""Identity graphs (Load, Save) over EXR files, against OpenEXR and OpenImageIO.

Usage: check_exr.py WARPLOOM. Reads the samples of openexr-images if they lie in ../shared/data beside the checkout.

Every attribute that does not say how samples are packed comes back byte for byte, every sample bit for bit, as OpenEXR
reads them; windows and channels also as OpenImageIO reads them. What a lossy file holds is what OpenEXR decodes,
and is written without loss. What is refused is refused with exit 4, and the mend that is named mends it.
"""

import itertools
import pathlib
import re
import struct
import subprocess
import sys
import tempfile

import numpy as np
import OpenEXR
import OpenImageIO as oiio

import exr_file
from exr_file import box, part, write

SAMPLES = pathlib.Path(__file__).resolve().parents[3] / "shared" / "data" / "openexr-images"
# Made anew: files are written as lines from top to bottom, at full resolution.
MADE_ANEW = {b"compression", b"chunkCount", b"lineOrder", b"tiles", b"type"}
LOSSLESS = {"NO": 0, "RLE": 1, "ZIPS": 2, "ZIP": 3, "PIZ": 4}
LOSSY = {"PXR24": 5, "B44": 6, "B44A": 7, "DWAA": 8, "DWAB": 9}
# Largest difference of a DWA sample from what OpenEXR decodes, part of the largest sample.
DWA_TOLERANCE = 1e-3
REFUSED = {
    "Trunks.exr": "deep data", "Balls.exr": "deep data", "Leaves.exr": "deep data",
    "Rec709_YC.exr": "subsampled", "XYZ_YC.exr": "subsampled",
}  # fmt: skip
random = np.random.default_rng(1)


def noise(dtype, width=37, height=19):
    """Any bits at all: NaNs with payloads, quiet and signalling, and subnormal numbers among them."""
    bits = np.uint16 if dtype == np.float16 else np.uint32
    return random.integers(0, np.iinfo(bits).max, (height, width), dtype=bits, endpoint=True).view(dtype)


def plain(channel="Y", /, **attributes):
    return part({channel: noise(np.float16)}, **attributes)


def every_half():
    return np.arange(65536, dtype=np.uint16).reshape(256, 256).view(np.float16)


def text(value):
    return b"string", value.encode()


# A value of each type that OpenEXR has, and of some that it has not.
ATTRIBUTES = {
    "box": box(-3, 7, 5, 9), "box2f": (b"box2f", struct.pack("<4f", -1, 0, 1.5, 2)),
    "chromaticities": (b"chromaticities", struct.pack("<8f", 0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329)),
    "double": (b"double", struct.pack("<d", -0.1)), "envmap": (b"envmap", b"\1"),
    "float": (b"float", struct.pack("<I", 0x7fa00001)), "floats": (b"floatvector", struct.pack("<3f", 1, 2, 3)),
    "framesPerSecond": (b"rational", struct.pack("<iI", 24000, 1001)), "int": (b"int", struct.pack("<i", -5)),
    "keyCode": (b"keycode", struct.pack("<7i", 1, 2, 3, 4, 5, 4, 64)),
    "m33f": (b"m33f", struct.pack("<9f", *range(9))), "m33d": (b"m33d", struct.pack("<9d", *range(9))),
    "worldToCamera": (b"m44f", struct.pack("<16f", *range(16))), "m44d": (b"m44d", struct.pack("<16d", *range(16))),
    "preview": (b"preview", struct.pack("<II", 2, 3) + bytes(range(24))),
    "multiText": (b"stringvector", struct.pack("<i", 3) + b"abc" + struct.pack("<i", 0)),
    "comments": text("two\nlines, ümlaut"), "empty": text(""),
    "oddTiles": (b"tiledesc", struct.pack("<IIB", 64, 32, 0)), "timeCode": (b"timecode", struct.pack("<II", 0x1234, 9)),
    "v2i": (b"v2i", struct.pack("<2i", 1, -2)), "v2f": (b"v2f", struct.pack("<2f", 1, -2)),
    "v2d": (b"v2d", struct.pack("<2d", 1, -2)), "v3i": (b"v3i", struct.pack("<3i", 1, -2, 3)),
    "v3f": (b"v3f", struct.pack("<3f", 1, -2, 3)), "v3d": (b"v3d", struct.pack("<3d", 1, -2, 3)),
    "colorInteropID": text("lin_ap1_scene"), "cryptomatte/1234567/manifest": text('{"a":"00000000"}'),
    "nobody/knows": (b"nobodyKnows", bytes(range(256))), "nothing": (b"nobodyKnows", b""),
    "attribute with a name of more than thirty-one bytes": (b"a type with a name of more than thirty-one bytes", b""),
    "screenWindowCenter": (b"v2f", struct.pack("<2f", 0.5, -0.25)),
    "screenWindowWidth": (b"float", struct.pack("<f", 2)), "pixelAspectRatio": (b"float", struct.pack("<f", 2)),
    "dwaCompressionLevel": (b"float", struct.pack("<f", 30)), "type": text("scanlineimage"), "name": text("beauty"),
}  # fmt: skip

CHANNEL_SETS = {
    "many": [f"aov{i:03}.{c}" for i, c in itertools.product(range(67), "RGB")],
    "nested": ["light1.specular.R", "light1.specular.G", "light1.R", "light1", "R", "light1.specular"],
    "not_ascii": ["R", "größe.é", "深度", "\u0301", "😀"],
    "depth": ["Z", "ZBack", "A"], "alphas": ["R", "G", "B", "RA", "GA", "BA"], "no_colour": ["id", "u", "v"],
    "cases": ["r", "R", "Red", "RED", "red", "a.R", "A.R", "A.r"],
    "odd": ["a b", ".", "..R", "R.", " ", "x" * 255],
}  # fmt: skip

WINDOWS = {
    "crop": ((5, 4), (0, 0, 100, 80)), "overscan": ((-8, -8), (0, 0, 21, 3)), "disjoint": ((500, 900), (0, 0, 40, 24)),
    "negative": ((-1007, -905), (-1000, -900, 30, 20)), "format_elsewhere": ((100, 50), (90, 40, 60, 60)),
}  # fmt: skip


def by_hand(folder):
    """Files that are written byte by byte."""
    files = {
        "attributes": [plain(**ATTRIBUTES)],
        "no_optional": [plain()],
        "one_pixel": [part({"R": noise(np.float32, 1, 1), "id": noise(np.uint32, 1, 1)}, (-1, -1))],
        "thin": [part({"Y": noise(np.float16, 300, 1)})],
        "every_half": [part({"Y": every_half()})],
        "decreasing": [plain(lineOrder=(b"lineOrder", b"\1"))],
        "linear": [part({"R": noise(np.float16), "S": noise(np.float32), "T": noise(np.uint32)}, linear=(b"R", b"T"))],
        "multi_view": [
            part({n: noise(np.float16) for n in ("R", "right.R", "left.Z")},
                 multiView=(b"stringvector", struct.pack("<i4si5s", 4, b"left", 5, b"right")))
        ],
        "stereo": [plain("R", name=text(n), view=text(n)) for n in ("left", "right")],
        "parts": [
            part({"R": noise(np.float16), "Z": noise(np.float32)}, (3, 4), box(0, 0, 50, 50), name=text("rgba"),
                 note=text("same"), own=text("a"), dataKind=text("x")),
            part({"id": noise(np.uint32, 5, 3)}, (-9, 60), box(0, 0, 50, 50), linear=(b"id",), name=text("ids"),
                 note=text("same"), own=text("b")),
            part({"R": noise(np.float32, 1, 2)}, (0, 0), box(0, 0, 50, 50), name=text("rgba.more"),
                 note=text("same"), comments=text("only here")),
        ],
    }  # fmt: skip
    for name, channels in CHANNEL_SETS.items():
        kinds = itertools.cycle((np.float16, np.float32, np.uint32))
        files[f"channels_{name}"] = [part({channel: noise(next(kinds), 9, 5) for channel in channels})]
    for name, (origin, display) in WINDOWS.items():
        files[f"window_{name}"] = [part({"R": noise(np.float16), "Z": noise(np.float32)}, origin, box(*display))]
    for name, parts in files.items():
        write(folder / f"{name}.exr", parts)
    for name, mode, rip in [("mip", 1, False), ("rip", 2, True)]:
        tiles = (b"tiledesc", struct.pack("<IIB", 16, 16, mode))
        header = part({"R": noise(np.float16), "Z": noise(np.float32)}, (-3, 2), tiles=tiles)
        write(folder / f"{name}.exr", [header], levels=(16, rip))
    return sorted(folder.glob("*.exr"))


def smooth(dtype, seed):
    y, x = np.mgrid[0:70, 0:130]
    return (np.sin(x / 17 + seed) * np.cos(y / 11) * 3 + 4 + (x > 60) * 20).astype(dtype)


def grainy(dtype, seed):
    grain = random.standard_normal((70, 130)) * 3
    return (smooth(np.float64, seed) + grain - (grain > 6) * 1e4).astype(dtype)


def by_openexr(folder):
    """Every compression and sort of samples, in lines and in tiles: what packs well, what does not, and any bits."""
    kinds = {"R": np.float16, "G": np.float16, "B": np.float16, "Z": np.float32, "id": np.uint32}
    for compression, storage in itertools.product(LOSSLESS | LOSSY, ("scanlineimage", "tiledimage")):
        contents = {"smooth": smooth, "grainy": grainy, "noise": lambda kind, _: noise(kind, 130, 70)}
        for content, draw in contents.items():
            if content == "noise" and compression in LOSSY:
                continue
            draws = {name: draw(kind, seed) for seed, (name, kind) in enumerate(kinds.items())}
            channels = {name: OpenEXR.Channel(array, 1, 1, name == "G") for name, array in draws.items()}
            header = {"compression": getattr(OpenEXR, f"{compression}_COMPRESSION"), "type": getattr(OpenEXR, storage)}
            if storage == "tiledimage":
                header["tiles"] = OpenEXR.TileDescription()
                header["tiles"].xSize, header["tiles"].ySize = 48, 32
            path = folder / f"{compression}_{storage}_{content}.exr"
            with OpenEXR.File(header, channels) as file:
                file.write(str(path))
            yield path


def samples_of(path):
    """Per part, arrays by channel, as OpenEXR reads them."""
    with OpenEXR.File(str(path), separate_channels=True) as file:
        return [{name: channel.pixels.copy() for name, channel in p.channels.items()} for p in file.parts]


def bits(array):
    return array.view(np.uint16 if array.dtype.itemsize == 2 else np.uint32)


def same_attributes(before, after):
    """Gives the compression of each part as it was."""
    (_, old), (_, new) = exr_file.headers(before), exr_file.headers(after)
    assert len(old) == len(new), f"{len(old)} parts, {len(new)} parts"
    for a, b in zip(old, new):
        for name, value in a.items():
            assert name in MADE_ANEW or b.get(name) == value, f"{name}: {value}, {b.get(name)}"
        added = b.keys() - a.keys() - MADE_ANEW - {b"screenWindowCenter", b"screenWindowWidth", b"pixelAspectRatio"}
        assert not added, f"added: {added}"
        was, now = a[b"compression"][1][0], b[b"compression"][1][0]
        assert now == (was if was in LOSSLESS.values() else LOSSLESS["ZIP"]), f"compression {was}, {now}"
    return [header[b"compression"][1][0] for header in old]


def same_samples(before, after, compressions):
    """Gives the largest difference of what DWA holds, of the largest sample."""
    worst = 0.0
    for old, new, compression in zip(samples_of(before), samples_of(after), compressions, strict=True):
        assert list(old) == list(new), f"{list(old)}, {list(new)}"
        for name, a in old.items():
            b = new[name]
            assert (a.dtype, a.shape) == (b.dtype, b.shape), f"{name}: {a.dtype} {a.shape}, {b.dtype} {b.shape}"
            if np.array_equal(bits(a), bits(b)):
                continue
            assert compression in (LOSSY["DWAA"], LOSSY["DWAB"]), f"{name}: samples differ"
            a, b = a.astype(np.float64), b.astype(np.float64)
            worst = max(worst, np.abs(a - b).max() / np.abs(a).max())
            assert worst < DWA_TOLERANCE, f"{name}: {worst} of the largest sample"
    return worst


def same_geometry(before, after):
    """Windows and channels as OpenImageIO reads them."""
    old, new = oiio.ImageBuf(str(before)), oiio.ImageBuf(str(after))
    assert old.nsubimages == new.nsubimages
    for number in range(old.nsubimages):
        old.reset(str(before), number)
        new.reset(str(after), number)
        a, b = old.spec(), new.spec()
        windows = ("x", "y", "width", "height", "full_x", "full_y", "full_width", "full_height")
        for field in (*windows, "format", "channelnames", "channelformats"):
            assert getattr(a, field) == getattr(b, field), f"{field}: {getattr(a, field)}, {getattr(b, field)}"


class Bench:
    def __init__(self, warploom, folder):
        self.warploom, self.folder, self.out = warploom, folder, folder / "out.exr"

    def identity(self, file, out=None):
        graph = self.folder / "identity.ron"
        out = out or self.out
        graph.write_text(
            f'Graph(version: 1, nodes: {{"in": Load(path: "{file}"), "out": Save(image: "in", path: "{out}")}})'
        )
        command = [self.warploom, "run", graph, "--no-cache", "--progress", "none"]
        return subprocess.run(command, capture_output=True, text=True)

    def comes_back(self, file):
        run = self.identity(file)
        assert run.returncode == 0, f"{file.name}: exit {run.returncode}\n{run.stderr}"
        try:
            compressions = same_attributes(file, self.out)
            worst = same_samples(file, self.out, compressions)
            same_geometry(file, self.out)
            # What was written is what was decoded: a second time changes no byte.
            again = self.folder / "again.exr"
            assert self.identity(self.out, again).returncode == 0 and again.read_bytes() == self.out.read_bytes()
            return worst
        except Exception as error:
            raise AssertionError(f"{file.name}: {error}") from error

    def is_refused(self, file, why):
        """Refused for that reason, with the part's name; and the command that is named makes a file that is not."""
        run = self.identity(file)
        assert run.returncode == 4 and why in run.stderr, f"{file.name}: exit {run.returncode}, not {why}\n{run.stderr}"
        names = [header[b"name"][1].decode() for header in exr_file.headers(file)[1] if b"name" in header]
        assert not names or any(f"`{name}`" in run.stderr for name in names), f"{file.name}: no part\n{run.stderr}"
        command = re.search(r"oiiotool (.*) -o out\.exr", run.stderr)
        assert command or why == "subsampled", f"{file.name}: no mend\n{run.stderr}"
        if command:
            mended = self.folder / "mended.exr"
            arguments = [str(file) if word == "in.exr" else word for word in command[1].split()]
            tool = pathlib.Path(sys.executable).parent / "oiiotool"
            subprocess.run([tool, *arguments, "-o", mended], check=True, capture_output=True)
            assert len(exr_file.headers(mended)[1]) == len(exr_file.headers(file)[1]), f"{file.name}: parts are lost"
            self.comes_back(mended)
        return 0.0


def refused(folder):
    """Files of sorts that are not supported, and the reason."""
    for compression in ("HTJ2K32", "HTJ2K256"):
        path = folder / f"{compression}.exr"
        header = {"compression": getattr(OpenEXR, f"{compression}_COMPRESSION"), "type": OpenEXR.scanlineimage}
        with OpenEXR.File(header, {"RGB": smooth(np.float16, 1)[..., None].repeat(3, 2)}) as file:
            file.write(str(path))
        yield path, "HTJ2K"
    parts = []
    for name, compression in [("sound", OpenEXR.ZIP_COMPRESSION), ("new", OpenEXR.HTJ2K32_COMPRESSION)]:
        header = {"compression": compression, "type": OpenEXR.scanlineimage}
        parts.append(OpenEXR.Part(header, {"Y": smooth(np.float16, 1)}, name))
    path = folder / "second_part.exr"
    with OpenEXR.File(parts) as file:
        file.write(str(path))
    yield path, "`new`"


def main():
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        bench = Bench(pathlib.Path(sys.argv[1]).resolve(), folder)
        made = folder / "made"
        made.mkdir()
        files = by_hand(made) + list(by_openexr(made))
        unsupported = list(refused(made))
        samples = sorted(p for p in SAMPLES.glob("**/*.exr") if "Damaged" not in p.parts)
        assert not samples or sum("DisplayWindow" in p.parts for p in samples) == 16
        for sample in samples:
            (unsupported.append((sample, REFUSED[sample.name])) if sample.name in REFUSED else files.append(sample))
        worst, faults = 0.0, []
        for file, why in [(file, None) for file in files] + unsupported:
            try:
                worst = max(worst, bench.is_refused(file, why) if why else bench.comes_back(file))
            except AssertionError as fault:
                faults.append(str(fault))
        if faults:
            sys.exit("\n".join(faults))
        print(f"{len(files)} files come and go unchanged; DWA to {worst:.1e} of the largest sample")
        print(f"refused, and mended where a command is named: {', '.join(file.name for file, _ in unsupported)}")


main()
