"""A short run of ``make fuzz``, the same every time, and documents of odd structure."""

import json
import random
import subprocess
import sys

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sketchmatch.errors import InvalidInputError
from sketchmatch.io.geojson import decode_geojson
from sketchmatch.io.stroke_json import decode_strokes
from sketchmatch.io.svg import decode_svg
from sketchmatch.model import PolygonSet, StrokeSet
from tests.fuzz.mutations import TOKENS, mutated
from tests.fuzz.property import KINDS, SEEDS, check, seeds
from tests.tools import ROOT

RUNS = dict.fromkeys(KINDS, 1500) | {"yaml": 500, "bmp": 300, "tiff": 300, "jpg": 300, "dxf": 200}
RUNS |= {"bag": 500, "mcap": 500, "db3": 500}
FOUND_EARLIER = sorted((SEEDS.parent / "found_earlier").iterdir())

# What Pillow has to say of broken tags is no error here.
pytestmark = pytest.mark.filterwarnings("ignore::UserWarning")


@pytest.mark.parametrize("kind", KINDS)
def test_the_seeds_can_be_read_and_are_small(kind, tmp_path):
    for data in seeds(kind):
        assert len(data) < 10_000
        assert check(kind, data, tmp_path, segmenting=False)


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_broken_files_are_read_or_refused_in_one_sentence(kind, tmp_path):
    rng, originals = random.Random(0), seeds(kind)
    for _ in range(RUNS[kind]):
        check(kind, mutated(rng, originals, kind), tmp_path, segmenting=False)


@pytest.mark.slow
@pytest.mark.parametrize("path", FOUND_EARLIER, ids=lambda path: path.name)
def test_what_was_found_stays_mended(path, tmp_path):
    check(path.suffix[1:], path.read_bytes(), tmp_path)


@pytest.mark.slow
def test_no_small_file_takes_a_gigabyte():
    # In a process of its own, whose memory is its own as well.
    script = (
        "import random, resource, tempfile, warnings; from pathlib import Path\n"
        "from tests.fuzz import property as p; from tests.fuzz.mutations import mutated\n"
        "warnings.simplefilter('ignore')\n"
        f"resource.setrlimit(resource.RLIMIT_AS, ({6 * 2**30}, {6 * 2**30}))\n"
        "with tempfile.TemporaryDirectory() as folder:\n"
        "    for kind in p.KINDS:\n"
        "        rng = random.Random(1)\n"
        "        for _ in range(100):\n"
        "            data = mutated(rng, p.seeds(kind), kind)\n"
        "            p.check(kind, data, Path(folder), segmenting=False)"
    )
    command = [sys.executable, "-c", script]
    done = subprocess.run(command, cwd=ROOT, stderr=subprocess.PIPE, check=False)
    assert done.returncode == 0, done.stderr.decode()


WORDS = st.sampled_from(
    [
        "type",
        "coordinates",
        "features",
        "geometry",
        "geometries",
        "properties",
        "label",
        "strokes",
        "points",
        "y_axis",
        "up",
        "down",
        "Polygon",
        "MultiPolygon",
        "Feature",
        "FeatureCollection",
    ]
)
NUMBERS = st.one_of(st.integers(), st.floats(), st.sampled_from([0, 1, 1e300, 10**400]))
VALUES = st.recursive(
    st.one_of(st.none(), st.booleans(), NUMBERS, WORDS, st.text(max_size=5)),
    lambda inner: st.one_of(
        st.lists(inner, max_size=5), st.dictionaries(WORDS | st.text(max_size=3), inner, max_size=5)
    ),
    max_leaves=30,
)
POSITIONS = st.one_of(st.lists(NUMBERS, min_size=2, max_size=3), VALUES)
RINGS = st.lists(POSITIONS, max_size=6)
POLYGONS = st.fixed_dictionaries(
    {"type": st.just("Polygon"), "coordinates": st.lists(RINGS, max_size=3)}
)
FEATURES = st.fixed_dictionaries(
    {"type": st.just("Feature"), "geometry": POLYGONS | VALUES, "properties": VALUES}
)
GEOJSON = st.one_of(
    VALUES,
    POLYGONS,
    st.fixed_dictionaries(
        {"type": st.just("FeatureCollection"), "features": st.lists(FEATURES, max_size=4)}
    ),
)
STROKES = st.fixed_dictionaries(
    {
        "strokes": st.lists(
            st.fixed_dictionaries({"points": RINGS}, optional={"label": VALUES}) | VALUES,
            max_size=4,
        )
    },
    optional={"y_axis": st.sampled_from(["up", "down"]) | VALUES},
)


def read_or_refused(decode, text, kind):
    try:
        assert isinstance(decode(text), kind)
    except InvalidInputError as refusal:
        sentence = str(refusal)
        assert "\n" not in sentence


@pytest.mark.slow
@given(GEOJSON)
@settings(max_examples=200)
def test_geojson_of_any_structure_is_read_or_refused(document):
    read_or_refused(decode_geojson, json.dumps(document), PolygonSet)


@pytest.mark.slow
@given(STROKES | VALUES)
@settings(max_examples=200)
def test_stroke_json_of_any_structure_is_read_or_refused(document):
    read_or_refused(decode_strokes, json.dumps(document), StrokeSet)


ATTRIBUTES = st.dictionaries(
    st.sampled_from(
        [
            "d",
            "points",
            "x",
            "y",
            "x1",
            "y1",
            "x2",
            "y2",
            "width",
            "height",
            "cx",
            "cy",
            "r",
            "rx",
            "ry",
            "transform",
            "style",
            "class",
            "fill",
            "stroke",
            "viewBox",
            "preserveAspectRatio",
            "clip-path",
            "transform-origin",
            "id",
            "href",
        ]
    ),
    st.one_of(
        st.sampled_from(
            [
                "0",
                "1",
                "-1",
                "5",
                "1e308",
                "1e-308",
                "nan",
                "10mm",
                "50%",
                "#a",
                "a",
                "M0,0h5v5z",
                "M0,0A1,2,3,0,1,5,6",
                "1,2,3,4,5,6",
                "rotate(45,1,2)",
                "matrix(1,2,3,4,5,6)",
                "scale(0)",
                "skewX(90)",
                "scale(1e200)",
                "0 0 9 9",
                "none",
                "xMaxYMid slice",
                "url(#a)",
                "red",
                "transform: rotate(1e9deg) scale(1e200)",
                "transform: translate(5%) skewX(90deg); x: 5%; r: auto",
                "fill: var(--a, var(--b)); --b: none; opacity: 0.5",
                "M0 0h9v9h-9zM1 1h7v7h-7z",
            ]
        ),
        st.text("MmLlHhVvCcSsQqTtAaZz0123456789.,-e ", max_size=20),
    ),
    max_size=5,
)
ELEMENTS = st.recursive(
    st.tuples(
        st.sampled_from(
            ["path", "line", "polyline", "polygon", "rect", "circle", "ellipse", "use"]
        ),
        ATTRIBUTES,
        st.just(()),
    ),
    lambda inner: st.tuples(
        st.sampled_from(["g", "a", "symbol", "svg", "switch", "clipPath"]),
        ATTRIBUTES,
        st.lists(inner, max_size=5),
    ),
    max_leaves=15,
)


def xml(element):
    name, attributes, children = element
    written = "".join(f' {key}="{value}"' for key, value in attributes.items())
    return f"<{name}{written}>{''.join(map(xml, children))}</{name}>"


@pytest.mark.slow
@given(st.lists(ELEMENTS, max_size=5))
@settings(max_examples=300)
def test_svg_of_any_structure_is_read_or_refused(elements):
    document = f"<svg>{''.join(map(xml, elements))}</svg>"
    read_or_refused(lambda text: decode_svg(text.encode()), document, StrokeSet)


def test_the_tokens_know_every_kind():
    assert set(TOKENS) == {path.name for path in SEEDS.iterdir()}
