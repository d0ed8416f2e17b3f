"""OpenEXR files byte by byte: every attribute as it stands in a file, and files that no library would write."""

import struct

import numpy as np

TILED, LONG_NAMES, DEEP, MULTI_PART = 1 << 9, 1 << 10, 1 << 11, 1 << 12
TYPES = {np.dtype(np.uint32): 0, np.dtype(np.float16): 1, np.dtype(np.float32): 2}


def headers(path):
    """The flags of a file and, per part, its attributes: name to type and bytes."""
    data = path.read_bytes()
    assert data[:4] == b"\x76\x2f\x31\x01", "no OpenEXR file"
    flags, at, parts = struct.unpack_from("<I", data, 4)[0], 8, []

    def text():
        nonlocal at
        end = data.index(0, at)
        found, at = data[at:end], end + 1
        return found

    while True:
        attributes = {}
        while name := text():
            kind = text()
            (size,) = struct.unpack_from("<i", data, at)
            attributes[name] = (kind, data[at + 4 : at + 4 + size])
            at += 4 + size
        if flags & MULTI_PART and not attributes:
            return flags, parts
        parts.append(attributes)
        if not flags & MULTI_PART:
            return flags, parts


def box(x, y, width, height):
    return b"box2i", struct.pack("<4i", x, y, x + width - 1, y + height - 1)


def channel_list(channels, linear=()):
    """The `channels` attribute of arrays by name, which are to be sorted."""
    entries = [name + struct.pack("<B4i", 0, TYPES[array.dtype], name in linear, 1, 1) for name, array in channels]
    return b"chlist", b"".join(entries) + b"\0"


def part(channels, origin=(0, 0), display=None, linear=(), **attributes):
    """A part of arrays by name, as attributes and sorted channels. Attributes are given as type and bytes."""
    channels = sorted(((name.encode(), array) for name, array in channels.items()), key=lambda entry: entry[0])
    height, width = channels[0][1].shape
    header = {
        b"channels": channel_list(channels, linear),
        b"compression": (b"compression", b"\0"),
        b"dataWindow": box(*origin, width, height),
        b"displayWindow": display or box(*origin, width, height),
        b"lineOrder": (b"lineOrder", b"\0"),
        b"pixelAspectRatio": (b"float", struct.pack("<f", 1)),
        b"screenWindowCenter": (b"v2f", struct.pack("<2f", 0, 0)),
        b"screenWindowWidth": (b"float", struct.pack("<f", 1)),
    }
    return header | {name.encode(): value for name, value in attributes.items()}, channels


def head(header):
    pieces = [n + b"\0" + k + b"\0" + struct.pack("<i", len(v)) + v for n, (k, v) in header.items()]
    return b"".join(pieces) + b"\0"


def lines(header, channels):
    """The blocks of an uncompressed part, each after its place: its row."""
    _, top, _, _ = struct.unpack("<4i", header[b"dataWindow"][1])
    rows = range(channels[0][1].shape[0])
    blocks = [(struct.pack("<i", top + y), b"".join(array[y].tobytes() for _, array in channels)) for y in rows]
    # The table is by rows in any case; the order in the file follows the attribute.
    return blocks, list(reversed(rows)) if header[b"lineOrder"][1] == b"\1" else list(rows)


def tiles(channels, side, rip):
    """The blocks of uncompressed tiles: level 0, and all others of a mip or rip map, where every sample is 0."""
    height, width = channels[0][1].shape
    shrunk = lambda size: [max(1, size >> level) for level in range(size.bit_length())]
    if rip:
        levels = [(lx, ly, w, h) for ly, h in enumerate(shrunk(height)) for lx, w in enumerate(shrunk(width))]
    else:
        sizes = max(shrunk(width), shrunk(height), key=len)
        levels = [(l, l, max(1, width >> l), max(1, height >> l)) for l in range(len(sizes))]
    blocks = []
    for lx, ly, w, h in levels:
        for y in range(0, h, side):
            for x in range(0, w, side):
                cut = lambda array: array[y : min(y + side, h), x : min(x + side, w)]
                arrays = [cut(array if lx == ly == 0 else np.zeros_like(array)) for _, array in channels]
                rows = [row.tobytes() for line in zip(*arrays) for row in line]
                blocks.append((struct.pack("<4i", x // side, y // side, lx, ly), b"".join(rows)))
    return blocks, list(range(len(blocks)))


def write(path, parts, flags=0, levels=None):
    """Writes parts of uncompressed lines, or one of tiles with `levels` (side, whether it is a rip map)."""
    flags |= 2 | (MULTI_PART if len(parts) > 1 else 0) | (TILED if levels else 0)
    blocks = [tiles(channels, *levels) if levels else lines(header, channels) for header, channels in parts]
    names = [n for header, channels in parts for n in [*header, *(n for n, _ in channels)]]
    flags |= LONG_NAMES if max(map(len, names)) > 31 else 0
    if len(parts) > 1:
        for (header, _), (found, _) in zip(parts, blocks):
            header[b"chunkCount"] = (b"int", struct.pack("<i", len(found)))
            header.setdefault(b"type", (b"string", b"scanlineimage"))
    data = struct.pack("<4sI", b"\x76\x2f\x31\x01", flags) + b"".join(head(header) for header, _ in parts)
    data += b"\0" if len(parts) > 1 else b""
    at = len(data) + 8 * sum(len(found) for found, _ in blocks)
    tables, body = b"", b""
    for number, (found, order) in enumerate(blocks):
        offsets = [0] * len(found)
        for index in order:
            offsets[index] = at + len(body)
            place, samples = found[index]
            body += struct.pack("<i", number) if len(parts) > 1 else b""
            body += place + struct.pack("<i", len(samples)) + samples
        tables += struct.pack(f"<{len(offsets)}Q", *offsets)
    path.write_bytes(data + tables + body)
