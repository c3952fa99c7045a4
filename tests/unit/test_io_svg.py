"""Strokes from SVG: shapes, transforms, curves, labels, and documents meant to harm."""

import numpy as np
import pytest

from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch.io import read_source, svg
from sketchmatch.io._svg_names import groups_label
from sketchmatch.io.svg import decode_svg
from sketchmatch.model import StrokeSet

NAMESPACES = (
    'xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink" '
    'xmlns:inkscape="http://www.inkscape.org/namespaces/inkscape"'
)


def strokes(body):
    return decode_svg(f"<svg {NAMESPACES}>{body}</svg>".encode()).strokes


def points(body):
    (stroke,) = strokes(body)
    return stroke.points


@pytest.mark.parametrize(
    ("body", "expected"),
    [
        ('<path d="M1 2 L3 4 5 6"/>', [[1, -2], [3, -4], [5, -6]]),
        ('<path d="m1,2 h2 v1 z"/>', [[1, -2], [3, -2], [3, -3], [1, -2]]),
        ('<line x1="1" y1="2" x2="3" y2="4"/>', [[1, -2], [3, -4]]),
        ('<polyline points="0,1 2,1 2,3" fill="none" stroke="red"/>', [[0, -1], [2, -1], [2, -3]]),
        ('<polygon points="0,1 2,1 2,3"/>', [[0, -1], [2, -1], [2, -3], [0, -1]]),
        (
            '<rect x="1" y="2" width="3" height="4"/>',
            [[1, -2], [4, -2], [4, -6], [1, -6], [1, -2]],
        ),
        ('<line x2="1in" y2="72pt"/>', [[0, 0], [96, -96]]),
    ],
)
def test_straight_shapes_keep_their_corners_and_y_turns_up(body, expected):
    assert points(body).tolist() == expected


@pytest.mark.parametrize(
    ("body", "radii"),
    [
        ('<circle cx="3" cy="2" r="5"/>', (5, 5)),
        ('<ellipse cx="3" cy="2" rx="8" ry="1"/>', (8, 1)),
        ('<path d="M8 2 A5 5 0 0 1 -2 2 A5 5 0 0 1 8 2 Z"/>', (5, 5)),
    ],
)
def test_curves_stay_within_a_thousandth_of_the_drawing(body, radii):
    ring = points(body)
    u, v = ((ring - (3, -2)) / radii).T
    assert np.abs(np.hypot(u, v) - 1).max() * min(radii) < 1e-3 * 2 * max(radii)
    middles = (ring[1:] + ring[:-1]) / 2
    u, v = ((middles - (3, -2)) / radii).T
    assert np.abs(np.hypot(u, v) - 1).max() * min(radii) < 1e-3 * 2 * max(radii)
    assert np.allclose(ring[0], ring[-1])
    assert 20 < len(ring) < 100


def test_beziers_are_followed():
    ring = points('<path d="M0 0 Q5 10 10 0"/>')
    x, y = ring.T
    assert np.allclose(-y, x * (10 - x) / 5)
    assert len(points('<path d="M0 0 C1 1 2 2 3 3"/>')) == 2


def test_transforms_apply_from_the_inside_out():
    body = (
        '<g transform="translate(10 0)"><g transform="rotate(90)">'
        '<line x1="1" x2="3" transform="scale(2)"/></g></g>'
    )
    # (1, 0) → (2, 0) → (0, 2) → (10, 2), then y up.
    assert np.allclose(points(body), [[10, -2], [10, -6]])


def test_use_repeats_what_it_names_where_it_says():
    body = (
        '<defs><g id="a"><path d="M0 0 1 1"/></g></defs>'
        '<symbol id="s"><path d="M0 0 2 2"/></symbol>'
        '<use href="#a" x="3" y="4"/><use xlink:href="#s" transform="scale(2)"/><use href="#none"/>'
    )
    assert [stroke.points.tolist() for stroke in strokes(body)] == [
        [[3, -4], [4, -5]],
        [[0, 0], [4, -4]],
    ]


@pytest.mark.parametrize(
    "circle",
    [
        '<g id="a"><path d="M0 0 1 1"/><use href="#a" x="9"/></g>',
        '<defs><g id="a"><use href="#b"/><path d="M0 0 1 1"/></g><g id="b"><use href="#a"/></g>'
        '</defs><use href="#a"/>',
        '<path d="M0 0 1 1"/><use href="#whole"/>',
    ],
)
def test_what_uses_itself_is_drawn_once(circle):
    document = f'<svg id="whole"><g stroke="red">{circle}</g></svg>'.encode()
    assert len(decode_svg(document).strokes) == 1


def test_what_is_used_again_and_again_is_named_once(monkeypatch):
    asked = []

    def label(element):
        asked.append(element.get("id"))
        return groups_label(element)

    monkeypatch.setattr(svg, "groups_label", label)
    desk = '<defs><g id="desk" data-name="desk"><rect width="2" height="1"/></g></defs>'
    uses = "".join(f'<use href="#desk" y="{3 * k}"/>' for k in range(5))
    assert [stroke.label for stroke in strokes(desk + uses)] == ["desk"] * 5
    assert asked.count("desk") == 1


def test_x_and_y_of_use_are_within_its_transform():
    body = (
        '<defs><path id="a" d="M0 0 1 0"/></defs><g transform="translate(100 0)">'
        '<use href="#a" x="3" y="4" transform="rotate(90) scale(2)"/></g>'
    )
    # (0, 0) → (3, 4) → (6, 8) → (−8, 6) → (92, 6) and (1, 0) → … → (92, 8), then y up.
    assert np.allclose(points(body), [[92, -6], [92, -8]])


def test_every_subpath_is_a_stroke():
    found = strokes('<path id="pair" d="M0 1 L1 1 M5 5 L6 5 6 6 Z L9 9"/>')
    assert [stroke.points.tolist() for stroke in found] == [
        [[0, -1], [1, -1]],
        [[5, -5], [6, -5], [6, -6], [5, -5]],
        [[5, -5], [9, -9]],
    ]
    assert {stroke.label for stroke in found} == {"pair"}


@pytest.mark.parametrize(
    ("attributes", "inside", "label"),
    [
        (
            'id="desk-2" inkscape:label="L" aria-label="A"',
            "<title> round table </title>",
            "round table",
        ),
        ('id="desk-2" inkscape:label="L" aria-label="A"', "<desc>d</desc>", "A"),
        ('id="desk-2" inkscape:label="L"', "", "L"),
        ('id="desk-2"', "", "desk-2"),
        ('id="path123"', "", ""),
        ('id="rect10-5"', "", ""),
        ('id="SVGID_1_"', "", ""),
        ('id="line_of_chairs"', "", "line_of_chairs"),
        ('id="dining_x0020_table"', "", "dining table"),
        ('id="_x31_2_x5F_chairs_x1F6CB_"', "", "12_chairs\U0001f6cb"),
        ('id="Layer_x0020_1"', "", ""),
        ('id="chair_1_"', "", "chair"),
        ('id="Rectangle 12"', "", ""),
        ('id="Combined-Shape"', "", ""),
        ('id="Star 1 of the show"', "", "Star 1 of the show"),
        ('id="a_x0000_b_xD800_c_xFFFFF_d"', "", "a_x0000_b_xD800_c_xFFFFF_d"),
        ("", "<title/>", ""),
    ],
)
def test_labels_are_what_a_person_named(attributes, inside, label):
    (stroke,) = strokes(f'<path d="M0 0 1 1" {attributes}>{inside}</path>')
    assert stroke.label == label


def test_what_is_not_drawn_is_ignored():
    drawn = '<path d="M0 0 1 1"/>'
    hidden = (
        f"<defs>{drawn}</defs><clipPath>{drawn}</clipPath><marker>{drawn}</marker>"
        f'<g display="none">{drawn}</g><g style="fill:red; display : none">{drawn}</g>'
        '<text>desk</text><image href="http://example.com/x.png"/><!-- <path d="M0 0 1 1"/> -->'
        '<rect width="0" height="4"/><path d="M3 3"/><path d=""/><circle/>'
    )
    assert len(strokes(hidden + drawn)) == 1


def test_a_document_type_without_definitions_is_harmless():
    document = (
        b'<?xml version="1.0"?><!DOCTYPE svg PUBLIC "-//W3C//DTD SVG 1.1//EN" '
        b'"http://www.w3.org/Graphics/SVG/1.1/DTD/svg11.dtd"><svg><line x2="3"/></svg>'
    )
    assert len(decode_svg(document).strokes) == 1


def test_the_entities_with_which_illustrator_names_things_are_words():
    document = """<?xml version="1.0" encoding="utf-8"?>
<!-- Generator: Adobe Illustrator 16.0.0, SVG Export Plug-In . SVG Version: 6.00 Build 0)  -->
<!DOCTYPE svg PUBLIC "-//W3C//DTD SVG 1.1//EN" "http://www.w3.org/Graphics/SVG/1.1/DTD/svg11.dtd" [
  <!ENTITY ns_extend "http://ns.adobe.com/Extensibility/1.0/">
  <!ENTITY ns_svg "http://www.w3.org/2000/svg">
  <!ENTITY st0 "fill:none;stroke:#000000;">
]>
<svg xmlns:x="&ns_extend;" xmlns="&ns_svg;" width="9" height="9">
  <switch>
    <foreignObject requiredExtensions="&ns_extend;" width="1" height="1"/>
    <g x:extraneous="self"><path id="desk" style="&st0;" d="M1 1h2v2"/></g>
  </switch>
</svg>"""
    (stroke,) = decode_svg(document.encode()).strokes
    assert (stroke.label, stroke.points.tolist()) == ("desk", [[1, -1], [3, -1], [3, -3]])


def laughs(depth):
    """Entities that grow tenfold with each level."""
    return "".join(f'<!ENTITY l{k} "' + f"&l{k - 1};" * 10 + '">' for k in range(1, depth + 1))


def uses(depth):
    """Groups that repeat each other, tenfold with each level."""
    return '<g id="u0"/>' + "".join(
        f'<g id="u{k}">' + f'<use href="#u{k - 1}"/>' * 10 + "</g>" for k in range(1, depth + 1)
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("document", "reason", "words"),
    [
        (
            f'<!DOCTYPE svg [<!ENTITY l0 "ha">{laughs(9)}]><svg>&l9;</svg>',
            "INVALID_FILE",
            "entities",
        ),
        (
            '<!DOCTYPE s [<!ENTITY x SYSTEM "file:///etc/passwd">]><svg>&x;</svg>',
            "INVALID_FILE",
            "entities",
        ),
        ('<!DOCTYPE s [<!ENTITY % x "a">]><svg/>', "INVALID_FILE", "entities"),
        ('<!DOCTYPE s [<!ATTLIST rect width CDATA "9">]><svg/>', "INVALID_FILE", "DTD of its own"),
        ('<!DOCTYPE s [<!ENTITY x "<g/>">]><svg>&x;</svg>', "INVALID_FILE", "entities"),
        (f'<!DOCTYPE s [<!ENTITY x "{"a" * 1001}">]><svg>&x;</svg>', "INVALID_FILE", "entities"),
        (
            f'<!DOCTYPE s [<!ENTITY x "{"a" * 1000}">]><svg>{"&x;" * 8389}</svg>',
            "INVALID_FILE",
            "too often, 8389 times",
        ),
        (f"<svg>{uses(9)}</svg>", "LIMIT_EXCEEDED", "the limit of 100000 elements"),
        ('<svg><g id="a"><use href="#a"/><use href="#a"/></g></svg>', "INVALID_FILE", "nothing"),
        ("<svg>" + "<g>" * 250 + "</g>" * 250 + "</svg>", "INVALID_FILE", "the limit of 200"),
        ("<svg>" + "<g>" * 100_000, "INVALID_FILE", "the limit of 200"),
    ],
    ids=[
        "laughs",
        "external",
        "parameter",
        "defaults",
        "element",
        "long",
        "repeated",
        "use bomb",
        "use loop",
        "deep",
        "deep and open",
    ],
)
def test_documents_meant_to_harm_are_refused(document, reason, words):
    with pytest.raises(InvalidInputError, match=words) as caught:
        decode_svg(document.encode())
    assert caught.value.reason == Reason(reason)
    assert "; " in caught.value.problem


@pytest.mark.parametrize(
    ("document", "words"),
    [
        ("", "is not SVG (no element found"),
        ("hello", "is not SVG (syntax error: line 1, column 0); save it as SVG again"),
        ("<svg><path></svg>", "is not SVG (mismatched tag"),
        ("<svg><po:ygon/></svg>", "is not SVG (unbound prefix"),
        ("<html/>", "is XML but not SVG: it begins with <html>; save it as SVG"),
        ('<?xml version="1.0" encoding="bogus"?><svg/>', "is not SVG"),
        ("<svg><text>desk</text></svg>", "has nothing drawn in it"),
        ('<svg><g transform="matrix(1 0)"/></svg>', "has a transform that cannot be read"),
        ('<svg><g id="a"/><use href="#a" x="q"/></svg>', "has an x or y that is not a length"),
    ],
)
def test_what_is_no_drawing_is_refused(document, words):
    with pytest.raises(InvalidInputError) as caught:
        decode_svg(document.encode())
    assert caught.value.reason == Reason.INVALID_FILE
    assert words in caught.value.problem


@pytest.mark.parametrize(
    "shape",
    [
        '<path id="sofa" d="M 0 0 L x 3"/>',
        '<path id="sofa" d="garbage"/>',
        '<path id="sofa" d="M 0 0 L 1e999 3"/>',
        '<path id="sofa" d="M 0 0 L 1e200 3"/>',
        '<path id="sofa" d="M 0 0 A 1 1 0 0 1 nan 3"/>',
        '<rect id="sofa" width="10mm" height="50%"/>',
        '<rect id="sofa" width="wide" height="5"/>',
    ],
)
def test_a_shape_that_cannot_be_read_is_named(shape):
    with pytest.raises(InvalidInputError) as caught:
        strokes(f'<path d="M0 0 1 1"/>{shape}')
    assert caught.value.field == "shapes[1]"
    assert 'id="sofa">) has ' in caught.value.problem
    assert caught.value.problem.endswith(
        ("; draw it again", "; write it in px", "; give <svg> a viewBox")
    )


def test_a_file_is_read_by_its_suffix(tmp_path):
    path = tmp_path / "sketch.svg"
    path.write_text(
        '<?xml version="1.0" encoding="UTF-8"?>\n<svg><line id="Tür" x2="3"/></svg>', "utf-8"
    )
    source = read_source(path)
    assert isinstance(source, StrokeSet)
    assert source.strokes[0].label == "Tür"
