"""Scene files that no program here writes, made of those that it does."""

from __future__ import annotations

import gzip
import json
import struct
from array import array

import zstandard

SPLATTING = "KHR_gaussian_splatting"
# A node that turns by 74 degrees about a slanting axis, scales and shifts.
PLACE = {"rotation": [0.2006, 0.4012, -0.4012, 0.7986], "scale": [1.5] * 3, "translation": [3.0, -1.0, 2.0]}


def in_colour(ply: bytes) -> bytes:
    """A PLY that `sample` wrote, with bands that differ from channel to channel."""
    header, rows = ply.split(b"end_header\n", 1)
    names = [line.split()[-1] for line in header.decode().splitlines() if line.startswith("property float ")]
    first, bands = names.index("f_rest_0"), sum(name.startswith("f_rest_") for name in names)
    values = array("f", rows)
    for row in range(0, len(values), len(names)):
        for i in range(bands):
            values[row + first + i] *= (1.5, -1.0, 0.5)[3 * i // bands]
    return header + b"end_header\n" + values.tobytes()


def spz_4(spz: bytes) -> bytes:
    """An SPZ of version 3 as one of version 4: a zstd stream a section, after a table of contents and an extension."""
    content = gzip.decompress(spz)
    magic, version, points = struct.unpack_from("<4sII", content)
    assert (magic, version) == (b"NGSP", 3)
    degree = content[12]
    sections, at = [], 16
    for size in (9, 1, 3, 3, 4, 3 * ((degree + 1) ** 2 - 1)):
        sections.append(content[at : at + size * points])
        at += size * points
    sections = [section for section in sections if section]
    streams = [zstandard.ZstdCompressor(level=12).compress(section) for section in sections]
    extension = bytes(20)
    toc = 32 + len(extension)
    # Flags: extensions are there.
    header = struct.pack("<4sII4BI12x", magic, 4, points, degree, content[13], 2, len(streams), toc)
    entries = [struct.pack("<QQ", len(new), len(old)) for new, old in zip(streams, sections, strict=True)]
    return b"".join([header, extension, *entries, *streams])


def open_glb(glb: bytes) -> tuple[dict, bytes]:
    """The JSON and the buffer of a binary glTF."""
    length = struct.unpack_from("<I", glb, 12)[0]
    return json.loads(glb[20 : 20 + length]), glb[28 + length :]


def glb(document: dict, buffer: bytes) -> bytes:
    """A binary glTF."""
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    buffer += bytes(-len(buffer) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(buffer), b"BIN\0") + buffer
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def glb_of_spz(spz: bytes, name: str) -> bytes:
    """A binary glTF whose splats are an SPZ, by an extension of this name, after bytes of something else."""
    splatting = {"extensions": {name: {"bufferView": 0}}}
    document = {
        "asset": {"version": "2.0"},
        "extensionsUsed": [SPLATTING, name],
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"mode": 0, "attributes": {}, "extensions": {SPLATTING: splatting}}]}],
        "bufferViews": [{"buffer": 0, "byteOffset": 8, "byteLength": len(spz)}],
        "buffers": [{"byteLength": 8 + len(spz)}],
    }
    return glb(document, bytes(8) + spz)


def in_two_places(file: bytes) -> bytes:
    """The splats of a glTF that `convert` wrote, half of them under nodes that turn, scale and shift."""
    document, buffer = open_glb(file)
    primitive = document["meshes"][0]["primitives"][0]
    count = document["accessors"][0]["count"]
    other = {}
    for name, index in primitive["attributes"].items():
        accessor = document["accessors"][index]
        width = document["bufferViews"][accessor["bufferView"]]["byteLength"] // count
        half = {key: accessor[key] for key in ("bufferView", "componentType", "type")}
        half |= {"byteOffset": count // 2 * width, "count": count - count // 2}
        other[name] = len(document["accessors"])
        document["accessors"].append(half)
        accessor["count"] = count // 2
    document["meshes"].append({"primitives": [primitive | {"attributes": other}]})
    document["nodes"] += [{"children": [2]} | PLACE, {"mesh": 1}]
    document["scenes"][0]["nodes"].append(1)
    return glb(document, buffer)
