"""Bytes that are almost those of a file: what a broken disk, tool or attacker makes of them."""

import random
import re
import struct
import zlib

INTERESTING = [0, 1, 2, 9, 10, 13, 32, 45, 48, 57, 64, 127, 128, 205, 254, 255]
NUMBERS = [
    *b"0 -0 1 -1 255 256 65535 65536 100000 2147483647 2147483648 4294967295 4294967296 1e999 "
    b"-1e999 1e308 1e-308 1e15 1e16 nan NaN inf -Infinity .inf .nan 0x7fffffff 1e5 0.5 . - + 1_000 "
    b"9223372036854775808 12:30:45 1e 00".split(),
    b"9" * 400,
    b"1" * 5000,
    b"0x" + b"f" * 4000,
]
TOKENS = {
    "yaml": [
        *b"image: |resolution: |origin: |negate: |mode: |- |? |: |[|]|{|}|&a |*a|<<: *a|!!binary |"
        b"!!python/object/apply:os.system [ls]|!!timestamp 2001-01-01|!!set |!!omap |!!float nan|"
        b"!!int x|---\n|...\n|%YAML 9.9\n|#|'|\"|\\x|>-\n|@|`|\t|true|null|~|\xff\xfe|\0|"
        b"/etc/passwd|../../../../etc/passwd|/dev/zero|/dev/stdin|.|..|raw|scale|trinary".split(
            b"|"
        ),
        b"a: &a [x,x,x,x,x,x,x,x,x]\nb: &b [*a,*a,*a,*a,*a,*a,*a,*a]\nc: &c [*b,*b,*b,*b,*b,*b]\n"
        b"d: &d [*c,*c,*c,*c,*c,*c,*c]\ne: &e [*d,*d,*d,*d,*d,*d]\nnegate: [*e,*e,*e,*e,*e,*e]\n",
        b"m: &m {k: v}\nn: &n {<<: [*m,*m,*m,*m,*m,*m]}\no: &o {<<: [*n,*n,*n,*n,*n,*n]}\n",
        b"[" * 900,
        b"{a: " * 400,
        b"- " * 900,
        b"? " * 900,
    ],
    "pgm": b"P1|P2|P3|P4|P5|P6|P7|Pf|PF|PyP|P5\n#|\n#\n|255|65535|65536|99999 99999|1 1|0 0| |\n|"
    b"-1|MAXVAL 255|WIDTH 9|ENDHDR\n|TUPLTYPE RGB_ALPHA\n".split(b"|"),
    "png": b"IHDR|PLTE|IDAT|IEND|tRNS|iCCP|gAMA|zTXt|iTXt|tEXt|eXIf|acTL|fcTL|fdAT|pHYs|sRGB|"
    b"\xff\xff\xff\xff|\x7f\xff\xff\xff|\0\0\0\0|\0\0\0\x01|\0\x01\x86\xa0".split(b"|"),
    "bmp": [b"BM", b"\x28\0\0\0", b"\x7c\0\0\0", b"\x0c\0\0\0", b"\0\0\0\0", b"\xff\xff\xff\x7f"],
    "tiff": [b"II*\0", b"MM\0*", b"II+\0", b"\0\x01", b"\x01\x03", b"\xff\xff\xff\xff", b"\x80\0"],
    "jpg": [
        *(bytes([0xFF, kind]) for kind in range(0xC0, 0x100)),
        b"\xff\xff",
        b"Exif\0\0",
        b"JFIF\0",
        b"MPF\0",
        b"ICC_PROFILE\0",
    ],
    "svg": [
        *b'<g>|</g>|<path d="|<use href="#a"/>|<svg|/>|>|<!--|-->|<![CDATA[|]]>|<?xml|?>|&amp;|'
        b'&#0;|&#x110000;|&lol;|<!DOCTYPE svg [<!ENTITY l "ha">]>|'
        b'<!DOCTYPE svg SYSTEM "/etc/passwd">|'
        b' transform="|matrix(1 2 3 4 5 6)|rotate(1e999)|rotate(45 1 1)|skewX(90)|scale(0)|'
        b"translate(|)|M0 0|A1 1 0 0 1 |A0 0 0 0 0 0 0|A1e308 1 0 1 1 9 9|C|S|Q|T|Z|z|z z z|h|V|"
        b' rx="|% |em|mm|in| points="1,2,3| style="display:none"| id="a"|xlink:href="#a"|'
        b'<rect width="1e308" height="1e308"/>|<symbol|<defs|<clipPath|viewBox="0 0 0 0"|'
        b'\xef\xbb\xbf|\xff\xfe|UTF-16|UTF-7|svg-source:excalidraw|inkscape:label="|aria-label="|'
        b"<title>|</title>|<style>|</style>|{|}|:|;|!important|@media screen{|@import|:not(|~|"
        b":has(|var(--ink)|--ink:|transform:|rotate(1e9deg)|scale(0%)|translate(1e308px)|opacity:0|"
        b'fill="url(#a)"|clip-path="url(#a)"|viewBox="0 0 1e308 1e-308"|preserveAspectRatio="none"|'
        b'<switch>|overflow="visible"|calc(|url(|\\'.split(b"|"),
        b"<g>" * 400,
        b'<g id="a">' + b'<use href="#a"/>' * 20 + b"</g>",
        b'<path d="' + b"A1 2 3 0 1 5 6" * 200 + b'"/>',
        b'<path d="M0 0' + b"z" * 3000 + b'"/>',
    ],
    "geojson": [
        *b'{|}|[|]|,|:|"type":|"Polygon"|"MultiPolygon"|"GeometryCollection"|"FeatureCollection"|'
        b'"Feature"|"LineString"|"coordinates":|"geometry":|"geometries":|"features":|"properties":|'
        b'"label":|"name":|null|true|false|"\\ud800"|"\\u0000"|[[[|]]]|[0,0]|[1e999,0]|[null,1]|'
        b'[true,1]|{"type":"Polygon","coordinates":[[[0,0],[1,0],[1,1]]]}|\xef\xbb\xbf|//|NaN'.split(
            b"|"
        ),
        b"[" * 3000,
        b'{"type":"GeometryCollection","geometries":[' * 150,
        b'{"type":"Feature","geometry":' * 300,
    ],
}
TOKENS["json"] = [
    *TOKENS["geojson"],
    *b'"strokes":|"points":|"y_axis":|"up"|"down"|[0,0,0]|[1,2,3,4]|[]|{"points":[[0,0],[1,1]]}'.split(
        b"|"
    ),
]
TOKENS["json"] += [
    *b'"type":"excalidraw"|"elements":|"shapes":|"shape_type":|"mask":|"circle"|"images":|"id":|'
    b'"annotations":|"segmentation":|"bbox":|"counts":|"size":|[99999,99999]|"nodes":|"edges":|'
    b'"layer_ids":|"attributes":|"bounding_box":|"dimensions":|"OBB"|"boundary":|"layer":4|'
    b'"source":3|"roundness":{"type":2}|"angle":|"containerId":|"groupIds":|[["g"]]|{"g":0}'.split(
        b"|"
    ),
]
TOKENS["excalidraw"] = TOKENS["json"]
TOKENS["xml"] = [
    *b'<image id="1">|</image>|<annotations>|<track>|<mask rle="1,2" left="0" top="0" width="9" '
    b'height="9"/>|<polygon points="|0,0;|;;|nan,inf;| rotation="|1e999| rle="|,,| frame="|'
    b' width="99999999"|<!DOCTYPE a [<!ENTITY l "ha">]>|&l;|<!--|-->|<?xml encoding="UTF-16"?>|'
    b"\xff\xfe|\0".split(b"|"),
    b"<track>" * 400,
    b'<box xtl="' * 200,
    b"0,0;" * 2000,
]
TOKENS["dxf"] = [
    *b"0\nINSERT\n2\nCHAIR\n|0\nHATCH\n|0\nSPLINE\n71\n3\n|0\nLWPOLYLINE\n90\n3\n70\n1\n|0\nBLOCK\n|"
    b"0\nENDSEC\n|0\nEOF\n|0\nENTITIES\n|10\n1e308\n|20\nnan\n|42\n1e9\n|70\n32767\n|71\n32767\n|"
    b"44\n1e300\n|8\n\xff\xfe\n|$INSUNITS|1\nAC1032\n|AutoCAD Binary DXF\r\n\x1a\0|999\n|\r\n|\0|"
    b"40\n0\n|40\n-1\n|0\nELLIPSE\n11\n0\n21\n0\n|0\nTEXT\n".split(b"|"),
]
TOKENS["bag"] = [
    *b"op=\x02|op=\x04|op=\x05|op=\x06|op=\x07|compression=lz4|compression=bz2|compression=none|"
    b"conn=\0\0\0\0|topic=/map|nav_msgs/OccupancyGrid|count=\xff\xff\xff\x7f|BZh9|"
    b"\x04\x22\x4d\x18|#ROSBAG V2.0\n|\xff\xff\xff\xff|\0\0\0\0|chunk_pos=|index_pos=".split(b"|"),
]
TOKENS["mcap"] = [
    *b"\x89MCAP0\r\n|zstd|lz4|ros2msg|ros2idl|cdr|/map|nav_msgs/msg/OccupancyGrid|\x28\xb5\x2f\xfd|"
    b"\xff\xff\xff\xff\xff\xff\xff\xff|\xff\xff\xff\xff\xff\xff\xff\x7f|\0\0\0\0\0\0\0\0".split(
        b"|"
    ),
    *(bytes([record]) + size.to_bytes(8, "little") for record in range(16) for size in (0, 40)),
]
TOKENS["db3"] = [
    *b"SQLite format 3\0|CREATE TABLE |CREATE VIEW |messages|topics|/map|"
    b"nav_msgs/msg/OccupancyGrid|\x0d\0\0\0|\x05\0\0\0|\x02\0\0\0|\x0a\0\0\0|\xff\xff\xff\xff|\0\0\0\0".split(
        b"|"
    ),
]
_WORDS = [0, 1, 255, 65535, 65536, 2**31 - 1, 2**31, 2**32 - 1]
_NUMBER = re.compile(rb"-?\d+(\.\d+)?")


def mutated(rng: random.Random, seeds: list[bytes], kind: str, longest: int = 10_000) -> bytes:
    """Return a seed with a few changes, below so many bytes."""
    data = bytearray(rng.choice(seeds))
    for _ in range(1 + min(int(rng.expovariate(0.5)), 12)):
        rng.choice(_CHANGES)(rng, data, seeds, TOKENS[kind])
    changed = bytes(data[: longest - 1])
    return with_checksums(changed) if kind == "png" and rng.random() < 0.8 else changed


def with_checksums(data: bytes) -> bytes:
    """Return a PNG whose chunks have the checksums of what they hold now."""
    made, at = bytearray(data), 8
    while at + 12 <= len(data):
        (length,) = struct.unpack_from(">I", data, at)
        end = at + 8 + length
        if end + 4 > len(data):
            break
        struct.pack_into(">I", made, end, zlib.crc32(data[at + 4 : end]))
        at = end + 4
    return bytes(made)


def _place(rng, data):
    return rng.randrange(len(data) + 1)


def _part(rng, data):
    start = _place(rng, data)
    return slice(start, start + 1 + int(rng.expovariate(0.05)))


def _flip(rng, data, _seeds, _tokens):
    if data:
        data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)


def _set(rng, data, _seeds, _tokens):
    if data:
        data[rng.randrange(len(data))] = rng.choice(INTERESTING)


def _delete(rng, data, _seeds, _tokens):
    del data[_part(rng, data)]


def _duplicate(rng, data, _seeds, _tokens):
    part = data[_part(rng, data)]
    at = _place(rng, data)
    data[at:at] = part * rng.choice([1, 1, 2, 3, 50])


def _insert(rng, data, _seeds, tokens):
    at = _place(rng, data)
    data[at:at] = rng.choice(tokens)


def _overwrite(rng, data, _seeds, tokens):
    token = rng.choice(tokens)
    at = _place(rng, data)
    data[at : at + len(token)] = token


def _renumber(rng, data, _seeds, _tokens):
    if numbers := list(_NUMBER.finditer(data)):
        found = rng.choice(numbers)
        data[found.start() : found.end()] = rng.choice(NUMBERS)


def _truncate(rng, data, _seeds, _tokens):
    del data[_place(rng, data) :]


def _splice(rng, data, seeds, _tokens):
    other = rng.choice(seeds)
    data[_place(rng, data) :] = other[_place(rng, other) :]


def _word(rng, data, _seeds, _tokens):
    if len(data) >= 4:
        at = rng.randrange(len(data) - 3)
        value = rng.choice(
            [0, 1, 255, 65535, 65536, 2**31 - 1, 2**31, 2**32 - 1, rng.getrandbits(16)]
        )
        data[at : at + 4] = value.to_bytes(4, rng.choice(["big", "little"]))


_CHANGES = (
    [_flip] * 3
    + [_set] * 2
    + [_insert] * 3
    + [_overwrite] * 2
    + [_renumber] * 3
    + [_delete, _duplicate, _truncate, _splice, _word]
)
