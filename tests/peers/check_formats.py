"""PNG, JPEG, TIFF and Radiance HDR against Pillow, OpenCV and OpenImageIO; colour profiles against LittleCMS.

Usage: check_formats.py WARPLOOM. LittleCMS is the one that comes with Pillow, called in doubles, relative colorimetric.
"""

import ctypes
import io
import pathlib
import struct
import subprocess
import sys
import tempfile
import zlib

import cv2
import numpy as np
import OpenImageIO as oiio
import PIL
from PIL import Image, ImageCms, ImageOps

LCMS = ctypes.CDLL(str(next((pathlib.Path(PIL.__file__).parent.parent / "pillow.libs").glob("liblcms2*"))))
D65, D50 = (0.3127, 0.3290), (0.345704, 0.358540)
REC_709 = ((0.64, 0.33), (0.30, 0.60), (0.15, 0.06))
P3 = ((0.68, 0.32), (0.265, 0.69), (0.15, 0.06))
ADOBE = ((0.64, 0.33), (0.21, 0.71), (0.15, 0.06))
PRO_PHOTO = ((0.734699, 0.265301), (0.159597, 0.840403), (0.036598, 0.000105))
SRGB_CURVE = (4, [2.4, 1 / 1.055, 0.055 / 1.055, 1 / 12.92, 0.04045])
RANDOM = np.random.default_rng(1)


def lcms(name, *arguments):
    function = getattr(LCMS, name)
    function.restype = ctypes.c_void_p
    return function(*arguments)


def doubles(values):
    return (ctypes.c_double * len(values))(*values)


def tone_curve(kind, parameters):
    curve = lcms("cmsBuildParametricToneCurve", None, kind, doubles(parameters))
    assert curve, (kind, parameters)
    return ctypes.c_void_p(curve)


def handle(white, primaries, curve):
    """A profile in memory: of RGB, or of grey without primaries."""
    curve = tone_curve(*curve)
    white = doubles([*white, 1.0])
    if primaries is None:
        return ctypes.c_void_p(lcms("cmsCreateGrayProfile", white, curve))
    places = doubles([value for x, y in primaries for value in (x, y, 1.0)])
    return ctypes.c_void_p(lcms("cmsCreateRGBProfile", white, places, (ctypes.c_void_p * 3)(*[curve] * 3)))


def profile(white, primaries, curve, version):
    made = handle(white, primaries, curve)
    LCMS.cmsSetProfileVersion.argtypes = [ctypes.c_void_p, ctypes.c_double]
    LCMS.cmsSetProfileVersion(made, version)
    size = ctypes.c_uint32(0)
    assert lcms("cmsSaveProfileToMem", made, None, ctypes.byref(size))
    out = ctypes.create_string_buffer(size.value)
    assert lcms("cmsSaveProfileToMem", made, out, ctypes.byref(size))
    return out.raw


def to_linear(icc, values):
    """Linear Rec.709 of stored values, 0..1, of shape (..., 3) or (..., 1)."""
    count = values.shape[-1]
    source = ctypes.c_void_p(lcms("cmsOpenProfileFromMem", icc, len(icc)))
    grey = count == 1
    target = handle(D65, None if grey else REC_709, (1, [1.0]))
    kind = ctypes.c_uint32(1 << 22 | (3 if grey else 4) << 16 | count << 3)
    transform = lcms("cmsCreateTransform", source, kind, target, kind, 1, ctypes.c_uint32(0x0140))
    assert transform
    values = np.ascontiguousarray(values, np.float64)
    out = np.empty_like(values)
    pointer = lambda array: array.ctypes.data_as(ctypes.c_void_p)
    LCMS.cmsDoTransform(ctypes.c_void_p(transform), pointer(values), pointer(out), ctypes.c_uint32(values.size // count))
    return out


def srgb_light(codes):
    """Linear light of sRGB codes, 0..1 (IEC 61966-2-1)."""
    return np.where(codes <= 0.04045, codes / 12.92, ((codes + 0.055) / 1.055) ** 2.4)


class Bench:
    """Files that go through the program together."""

    def __init__(self, warploom, folder):
        self.warploom, self.folder, self.count, self.refusals = warploom, folder, 0, 0
        self.nodes, self.checks = [], []

    def path(self, extension):
        self.count += 1
        return self.folder / f"f{self.count}.{extension}"

    def load(self, path, check, encoding="Auto"):
        """Reads a file, and has `check` look at its samples."""
        number = len(self.checks)
        self.nodes.append(f'"in{number}": Load(path: "{path}", encoding: {encoding})')
        self.nodes.append(f'"out{number}": Save(image: "in{number}", path: "out{number}.exr", depth: Float)')
        self.checks.append((path, check))

    def write(self, source, extension, options, check):
        """Reads a file and writes it in a format."""
        number, out = len(self.nodes), self.path(extension)
        self.nodes.append(f'"from{number}": Load(path: "{source}")')
        self.nodes.append(f'"to{number}": Save(image: "from{number}", path: "{out}", {options})')
        self.checks.append((out, check))

    def run(self, nodes):
        graph = self.folder / "graph.ron"
        graph.write_text("Graph(version: 1, nodes: {" + ",\n".join(nodes) + "})")
        command = [self.warploom, "run", graph, "--no-cache", "--progress", "none"]
        return subprocess.run(command, capture_output=True, text=True)

    def refused(self, path, words):
        run = self.run([f'"in": Load(path: "{path}")', '"out": Save(image: "in", path: "none.exr")'])
        assert run.returncode == 4 and all(word in run.stderr for word in words), f"{path}: {run.returncode}\n{run.stderr}"
        self.refusals += 1

    def finish(self):
        run = self.run(self.nodes)
        assert run.returncode == 0, run.stderr[-3000:]
        for number, (path, check) in enumerate(self.checks):
            out = self.folder / f"out{number}.exr"
            check(samples(out) if out.exists() else path)
        print(f"{len(self.checks)} files agree")


def samples(path):
    """As R, G, B, A or Y, A, without the axis of a single channel."""
    image = oiio.ImageInput.open(str(path))
    names = image.spec().channelnames
    pixels = image.read_image(0, 0, 0, len(names), oiio.FLOAT)
    order = sorted(range(len(names)), key=lambda at: "RGBYA".index(names[at]))
    return pixels[..., order]


def equal(expected, tolerance=0.0, what=""):
    expected = np.asarray(expected, np.float64)
    expected = expected[..., None] if expected.ndim == 2 else expected

    def check(found):
        assert found.shape == expected.shape, f"{what}: {found.shape}, {expected.shape}"
        worst = np.max(np.abs(np.float64(found) - expected))
        assert worst <= tolerance, f"{what}: {worst} apart"

    return check


def profiles():
    """Name, bytes, and whether it is of grey."""
    spaces = [("Display P3", D65, P3, SRGB_CURVE), ("Adobe RGB", D65, ADOBE, (1, [563 / 256])),
              ("ProPhoto", D50, PRO_PHOTO, (1, [1.8])), ("linear", D65, REC_709, (1, [1.0])),
              ("parametric", D65, P3, (5, [2.2, 0.9, 0.1, 0.4, 0.1, 0.01, 0.002])), ("sRGB", D65, REC_709, SRGB_CURVE),
              ("gamma 2.2 grey", D65, None, (1, [2.2])), ("sRGB grey", D65, None, SRGB_CURVE)]
    for name, white, primaries, curve in spaces:
        for version in (2.1, 4.3):
            yield f"{name} {version}", profile(white, primaries, curve, version), primaries is None
    yield "Pillow's sRGB", ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes(), False


def check_profiles(bench):
    colours = RANDOM.integers(0, 256, (24, 40, 3), np.uint8)
    colours[0, :8] = [[r, g, b] for r in (0, 255) for g in (0, 255) for b in (0, 255)]
    colours[1:8, :, :] = np.arange(280).reshape(7, 40, 1) % 256
    for name, icc, grey in profiles():
        stored = colours[..., 0] if grey else colours
        expected = to_linear(icc, (stored[..., None] if grey else stored) / 255.0)
        for extension, options in (("png", {}), ("tif", {}), ("jpg", {"quality": 95, "subsampling": 0})):
            path = bench.path(extension)
            Image.fromarray(stored).save(path, icc_profile=icc, **options)
            if extension == "jpg":
                # What the file holds is another decoder's matter: the codes that the program itself finds, converted.
                bench.load(path, lambda found, icc=icc: jpeg_codes.append((icc, found)), "Raw")
                bench.load(path, lambda found, name=name: from_codes(found, name))
            else:
                bench.load(path, equal(expected, 1e-4, f"{name} .{extension}"))
        if not grey:
            # Floats go through the curves beyond 0..1 as well.
            values = RANDOM.uniform(0, 1, (5, 7, 3)).astype(np.float32)
            path = bench.path("tif")
            spec = oiio.ImageSpec(7, 5, 3, "float")
            spec.attribute("ICCProfile", oiio.TypeDesc(f"uint8[{len(icc)}]"), np.frombuffer(icc, np.uint8))
            out = oiio.ImageOutput.create(str(path))
            assert out.open(str(path), spec) and out.write_image(values), out.geterror()
            out.close()
            bench.load(path, equal(to_linear(icc, values), 1e-4, f"{name} of floats"))


jpeg_codes = []


def from_codes(found, name):
    icc, codes = jpeg_codes.pop()
    equal(to_linear(icc, codes), 1e-4, f"{name} .jpg")(found)


def renamed(icc, names):
    for old, new in names:
        icc = icc.replace(old, new)
    return icc


def check_refusals(bench):
    colours = Image.fromarray(RANDOM.integers(0, 256, (4, 4, 3), np.uint8))
    icc = profile(D65, P3, SRGB_CURVE, 4.3)
    lut = renamed(icc, [(b"rXYZ", b"A2B0"), (b"gXYZ", b"A2B1"), (b"bXYZ", b"A2B2")])
    for extension in ("png", "tif", "jpg"):
        for bad, words in ((lut, ["(A2B)", "RGB built-in"]), (icc[:16] + b"CMYK" + icc[20:], ["CMYK"]), (b"rubbish", ["damaged"])):
            path = bench.path(extension)
            colours.save(path, icc_profile=bad)
            bench.refused(path, [*words, "encoding: Srgb"])
    path = bench.path("jpg")
    colours.convert("CMYK").save(path)
    bench.refused(path, ["CMYK"])
    path = bench.path("tif")
    pixels = RANDOM.integers(0, 256, (21, 33, 1)).astype(np.uint8)
    spec = oiio.ImageSpec(33, 21, 1, "uint8")
    spec["compression"] = "lzw"
    spec.tile_width = spec.tile_height = 16
    spec.tile_depth = 1
    out = oiio.ImageOutput.create(str(path))
    assert out.open(str(path), spec) and out.write_image(pixels), out.geterror()
    out.close()
    bench.refused(path, ["LZW", "oiiotool"])
    print(f"{bench.refusals} files are refused, and told why")


def check_png(bench):
    every = np.arange(256, dtype=np.uint8).reshape(16, 16)
    word = RANDOM.integers(0, 65536, (16, 16, 4), np.uint16)
    for array in (every, np.dstack([every, every.T]), np.dstack([every, every.T, every[::-1], every.T[::-1]])):
        path = bench.path("png")
        Image.fromarray(array).save(path)
        bench.load(path, equal(np.float32(array / 255.0), what="PNG"), "Raw")
    for bits in (1, 2, 4, 8):
        image = Image.frombytes("P", (16, 16), (every & (1 << bits) - 1).tobytes())
        image.putpalette([(i * 37) % 256 for i in range(3 << bits)])
        path = bench.path("png")
        image.save(path, bits=bits, transparency=bytes(range(1 << bits)))
        bench.load(path, equal(np.float32(np.array(Image.open(path).convert("RGBA")) / 255.0), what=f"{bits} bits"), "Raw")
    path = bench.path("png")
    Image.fromarray(every).convert("1").save(path)
    bench.load(path, equal(np.array(Image.open(path)) * 1.0, what="PNG of 1 bit"), "Raw")
    for channels, order in ((1, [0]), (3, [2, 1, 0]), (4, [2, 1, 0, 3])):
        path = bench.path("png")
        assert cv2.imwrite(str(path), word[..., :channels])
        bench.load(path, equal(np.float32(word[..., order] / 65535.0), what="PNG of 16 bits"), "Raw")


def check_tiff(bench):
    for kind, largest in (("uint8", 255.0), ("uint16", 65535.0), ("float", 1.0)):
        for channels in (1, 3, 4):
            for compression in ("none", "lzw", "zip"):
                for planes in ("contig", "separate"):
                    # Padded tiles of LZW are more than the decoder can do.
                    for tile in (0, 16) if compression != "lzw" else (0,):
                        spec = oiio.ImageSpec(33, 21, channels, kind)
                        spec["compression"], spec["planarconfig"] = compression, planes
                        spec["oiio:UnassociatedAlpha"] = 1
                        spec.tile_width = spec.tile_height = tile
                        spec.tile_depth = 1 if tile else 0
                        pixels = RANDOM.standard_normal((21, 33, channels)).astype(np.float32)
                        if kind != "float":
                            pixels = RANDOM.integers(0, int(largest) + 1, pixels.shape).astype(kind)
                        path = bench.path("tif")
                        out = oiio.ImageOutput.create(str(path))
                        assert out.open(str(path), spec) and out.write_image(pixels), out.geterror()
                        out.close()
                        expected = np.float32(pixels / largest) if largest > 1 else pixels
                        bench.load(path, equal(expected, what=f"TIFF {kind} {channels} {compression} {planes} {tile}"), "Raw")
    for largest, kind in ((255, np.uint8), (65535, np.uint16)):
        values = RANDOM.integers(0, largest + 1, (9, 13)).astype(kind)
        path = bench.path("tif")
        Image.fromarray(values).save(path, tiffinfo={262: 0})
        # Pillow turns 8 bits round as it writes them, and leaves 16 bits as they are.
        expected = values if largest == 255 else largest - values
        bench.load(path, equal(np.float32(expected / largest), what=f"WhiteIsZero of {largest}"), "Raw")


def check_jpeg(bench):
    y, x = np.mgrid[0:61, 0:83]
    smooth = np.dstack([128 + 120 * np.sin(x / 9), 128 + 120 * np.cos(y / 7), (x + y) * 255 / 144]).astype(np.uint8)
    for mode, options, tolerance in (
        ("RGB", {"quality": 95, "subsampling": 0}, 2),
        ("RGB", {"quality": 80, "subsampling": 0, "progressive": True}, 2),
        ("L", {"quality": 90}, 1),
        # Colour is stored at half the size, and readers enlarge it in ways of their own.
        ("RGB", {"quality": 90, "subsampling": 2}, 4),
    ):
        path = bench.path("jpg")
        Image.fromarray(smooth).convert(mode).save(path, **options)
        expected = np.array(Image.open(path)) / 255.0
        bench.load(path, equal(expected, (tolerance + 0.01) / 255, f"JPEG {mode} {options}"), "Raw")
    for orientation in range(1, 9):
        path = bench.path("jpg")
        exif = Image.Exif()
        exif[0x0112] = orientation
        Image.fromarray(smooth).convert("L").save(path, quality=90, exif=exif)
        expected = np.array(ImageOps.exif_transpose(Image.open(path))) / 255.0
        bench.load(path, equal(expected, 1.01 / 255, f"JPEG of orientation {orientation}"), "Raw")


def check_hdr(bench):
    pixels = np.exp(RANDOM.normal(0, 4, (23, 40, 3))).astype(np.float32)
    path = bench.path("hdr")
    assert cv2.imwrite(str(path), pixels)
    stored = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)[..., ::-1]
    bench.load(path, equal(stored, what="HDR"))
    bench.write(path, "hdr", "", lambda out: equal(stored, what="HDR again")(cv2.imread(str(out), cv2.IMREAD_UNCHANGED)[..., ::-1]))


def chunks(file):
    at = 8
    while at < len(file):
        length, = struct.unpack(">I", file[at : at + 4])
        assert zlib.crc32(file[at + 4 : at + 8 + length]) == struct.unpack(">I", file[at + 8 + length : at + 12 + length])[0]
        yield file[at + 4 : at + 8], file[at + 8 : at + 8 + length]
        at += 12 + length


def check_written(bench):
    """Others read from what is written the same samples, and how they are encoded."""
    for grey in (False, True):
        stored = RANDOM.integers(0, 256, (16, 16) if grey else (16, 16, 3), np.uint8)
        source = bench.path("png")
        Image.fromarray(stored).save(source)

        def png(out, stored=stored):
            assert np.array_equal(np.array(Image.open(out)), stored)
            told = dict(chunks(out.read_bytes()))
            assert told[b"sRGB"] == b"\0" and told[b"gAMA"] == struct.pack(">I", 45455) and len(told[b"cHRM"]) == 32

        def linear_png(out):
            told = dict(chunks(out.read_bytes()))
            assert b"sRGB" not in told and told[b"gAMA"] == struct.pack(">I", 100000)

        def silent_png(out):
            assert [name for name, _ in chunks(out.read_bytes())] == [b"IHDR", b"IDAT", b"IEND"]

        def by_profile(name, exact, light, stored=stored, grey=grey):
            def check(out):
                image = Image.open(out)
                icc = image.info["icc_profile"]
                assert ImageCms.getProfileDescription(ImageCms.ImageCmsProfile(io.BytesIO(icc))).strip() == name
                # What another reader makes of the profile, and of the file's own codes by it.
                codes = np.array(image, np.float64) / 255.0
                worst = np.max(np.abs(to_linear(icc, codes[..., None] if grey else codes).reshape(codes.shape) - light(codes)))
                assert worst < 1e-3, f"{name}: {worst} apart"
                if exact:
                    assert np.array_equal(np.array(image), stored)

            return check

        bench.write(source, "png", "encoding: Srgb", png)
        bench.write(source, "png", "encoding: Linear", linear_png)
        bench.write(source, "png", "encoding: Raw", silent_png)
        bench.write(source, "tif", "", by_profile("sRGB", True, srgb_light))
        bench.write(source, "jpg", "", by_profile("sRGB", False, srgb_light))
        bench.write(source, "tif", "encoding: Linear", by_profile("Linear Rec.709", False, lambda codes: codes))


def main():
    with tempfile.TemporaryDirectory() as name:
        bench = Bench(pathlib.Path(sys.argv[1]).resolve(), pathlib.Path(name))
        for check in (check_profiles, check_png, check_tiff, check_jpeg, check_hdr, check_written):
            check(bench)
        bench.finish()
        check_refusals(bench)


main()
