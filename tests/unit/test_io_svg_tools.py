"""Drawings in the shape in which vector tools export them."""

from pathlib import Path

import numpy as np
import pytest

from sketchmatch.io import read_source
from sketchmatch.io.svg import decode_svg

DATA = Path(__file__).parents[1] / "data"


def box(stroke):
    return [*stroke.points.min(axis=0), *stroke.points.max(axis=0)]


def test_inkscape_gives_shapes_with_their_labels_and_without_hidden_layers():
    bed, table, round_, plant = read_source(DATA / "inkscape.svg").strokes
    assert [item.label for item in (bed, table, round_, plant)] == ["bed", "table", "", "plant"]
    assert np.allclose(box(bed), [20, -50, 80, -20])
    assert len(bed.points) > 8, "rounded corners are round"
    reach = (20 + 10) / np.sqrt(2)
    assert np.allclose(box(table), [130 - reach, -55 - reach, 130 + reach, -55 + reach])
    assert np.allclose(box(round_), [25, -145, 55, -115], atol=0.1)
    assert np.allclose(box(plant), [102, -147, 118, -123], atol=0.1)
    for stroke in (bed, table, round_, plant):
        assert np.allclose(stroke.points[0], stroke.points[-1])


def test_excalidraw_gives_the_outlines_drawn_twice_without_paper_hatching_or_filling():
    strokes = read_source(DATA / "excalidraw.svg").strokes
    sofa, shelf, table = strokes[:8], strokes[8:16], strokes[16:]
    assert len(table) == 2, "an ellipse is two strokes, a rectangle two a side"
    for drawn, expected in (
        (sofa, [20, -84, 130, -24]),
        (shelf, [255, -125, 305, -5]),
        (table, [60, -280, 140, -200]),
    ):
        boxes = np.array([box(stroke) for stroke in drawn])
        found = [*boxes[:, :2].min(axis=0), *boxes[:, 2:].max(axis=0)]
        assert np.allclose(found, expected, atol=4), found


@pytest.mark.parametrize(
    ("rect", "root", "paper"),
    [
        ('<rect width="100%" height="100%" fill="white"/>', "", True),
        ('<rect width="40" height="30" fill="#fff"/>', 'width="40" height="30"', True),
        ('<rect width="40" height="30"/>', 'viewBox="0 0 40 30" width="4cm"', True),
        ('<rect width="40" height="30" stroke="#000"/>', 'width="40" height="30"', False),
        ('<rect width="40" height="30" style="stroke:#000"/>', 'viewBox="0,0,40,30"', False),
        ('<rect width="20" height="30"/>', 'viewBox="0 0 40 30"', False),
    ],
)
def test_paper_is_no_shape(rect, root, paper):
    found = decode_svg(f'<svg {root}>{rect}<path d="M1 1 2 2"/></svg>'.encode()).strokes
    assert len(found) == (1 if paper else 2)


GRAPHVIZ = (
    '<g class="edge"><title>hall-&gt;bath</title>'
    '<path fill="none" stroke="black" d="M155,-143C167,-133 183,-121 197.2,-111"/>'
    '<polygon fill="black" stroke="black" '
    'points="199.4,-113.7 205.1,-104.8 195.1,-108.2 199.4,-113.7"/></g>'
)
DRAWIO = (
    '<path d="M80 30L193.6 30" fill="none" stroke="#000"/>'
    '<path d="M198.8 30L191.8 33.5L193.6 30L191.8 26.5Z" fill="#000" stroke="#000"/>'
)
ACROSS = '<path d="M0 0H99" fill="none" stroke="#000"/>'
DOWN = '<path d="M0 0V99" fill="none" stroke="#000"/>'
OTHER_END = '<path d="M74.8 30L81.8 26.5L80 30L81.8 33.5Z" fill="#000"/>'


@pytest.mark.parametrize(
    ("drawn", "count"),
    [
        (GRAPHVIZ, 1),
        (DRAWIO, 1),
        (DRAWIO.replace('fill="#000"', 'fill="red"'), 2),
        (DRAWIO + OTHER_END, 0),
        (DRAWIO + '<path d="M190 26H198V34H190z"/>', 2),
        ('<path d="M0 0H9" fill="none" stroke="#000"/><path d="M9 -9V9L29 0z"/>', 2),
        ('<path d="M0 0H99" fill="none" stroke="#000"/><path d="M99 0L88 2"/>', 2),
        (OTHER_END, 1),
        ('<path d="M0 500H99" fill="none" stroke="#000"/>' + DRAWIO, 2),
        (f'{ACROSS}<path d="M99 0L60 24V-24z"/>', 1),
        (f'{ACROSS}<path d="M99 0L40 30V-30z"/>', 2),  # too large
        (f'{ACROSS}<path d="M120 0L113 3V-3z"/>', 2),  # beside its end
        (f'{ACROSS}<path d="M99 9L92 12V6z"/>', 2),
        (f'{ACROSS}<path d="M99 0Q92 3 92 -3z"/>', 2),  # round
        (f'{ACROSS}<path d="M99 0L92 3V-3zM109 0L102 3V-3z"/>', 3),
        (f'{DOWN}<path d="M0 99L24 60H-24z"/>', 1),
        (f'{DOWN}<path d="M0 99L30 40H-30z"/>', 2),
    ],
)
def test_arrowheads_are_no_shapes(drawn, count):
    found = decode_svg(f'<svg><path d="M300 0h50v50z"/>{drawn}</svg>'.encode())
    assert len(found.strokes) == 1 + count
    assert bool(found.notes) == (count == 0)


@pytest.mark.parametrize(
    ("transform", "expected"),
    [
        ("rotate(90 10 10)", [[20, 0], [20, 10]]),
        ("rotate(90, 10, 10)", [[20, 0], [20, 10]]),
        ("matrix(0 1 -1 0 5 6)", [[5, 6], [5, 16]]),
        ("matrix(1,0,0,1,5,6)", [[5, 6], [15, 6]]),
        ("translate(5) scale(2 3)", [[5, 0], [25, 0]]),
        ("skewY(45)", [[0, 0], [10, 10]]),
        (" translate( 1e1 , -2 ) ", [[10, -2], [20, -2]]),
    ],
)
def test_transforms(transform, expected):
    (stroke,) = decode_svg(f'<svg><line x2="10" transform="{transform}"/></svg>'.encode()).strokes
    assert np.allclose(stroke.points * (1, -1), expected)


def test_every_path_command_is_followed():
    path = "M10 10 H20 V20 h-5 v5 L1 2 l3 4 C5 6 7 8 9 9 c1 1 2 2 3 0 S1 2 3 4 s1 2 3 4 Q1 2 3 4 "
    path += "q1 2 3 4 T9 9 t1 1 A5 4 30 0 1 30 30 a5 4 30 1 0 5 5 m1 1 l2 2 Z"
    first, second = decode_svg(
        f'<svg fill="none" stroke="red"><path d="{path}"/></svg>'.encode()
    ).strokes
    assert first.points[0].tolist() == [10, -10]
    assert np.allclose(first.points[-1], [35, -35])
    assert np.allclose(second.points, [[36, -36], [38, -38], [36, -36]])


def test_arcs_with_packed_flags_are_read():
    (stroke,) = decode_svg(
        b'<svg fill="none" stroke="red"><path d="M0 0a25 25 0 0150 0"/></svg>'
    ).strokes
    assert np.allclose(stroke.points[-1], [50, 0])


def test_groups_give_their_labels_to_shapes_without_one_and_layers_do_not():
    body = (
        '<g inkscape:label="Layer" inkscape:groupmode="layer"><path d="M0 0 1 1"/>'
        '<g aria-label="desk"><g><path d="M0 0 1 1"/></g><path id="lamp" d="M0 0 1 1"/></g>'
        '<g><title>bed</title><path d="M0 0 1 1"/></g></g>'
        '<g id="Layer_1" data-name="Layer 1"><path d="M0 0 1 1"/></g>'
    )
    space = 'xmlns:inkscape="http://www.inkscape.org/namespaces/inkscape"'
    found = decode_svg(f"<svg {space}><title>Room</title>{body}</svg>".encode()).strokes
    assert [stroke.label for stroke in found] == ["", "desk", "lamp", "bed", ""]
