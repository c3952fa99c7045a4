"""What a browser shows of an SVG drawing is what is read of it.

The boxes below are those that Chromium 156 gives for the same documents.
"""

from pathlib import Path

import numpy as np
import pytest

from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch.io import read_source
from sketchmatch.io.svg import decode_svg
from sketchmatch.model.limits import SourceLimits, limited_to
from sketchmatch_builtin.segmenters.strokes import StrokeSegmenter
from tests.pace import within

CASES = Path(__file__).parents[3] / "shared" / "data" / "cases"
needs_cases = pytest.mark.skipif(not CASES.is_dir(), reason=f"{CASES} is not here")

PAGE = 'width="800" height="600" viewBox="0 0 800 600"'
NAMESPACES = 'xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink"'
KEPT = '<path d="M10 20h30v40h-30z" fill="none" stroke="black"/>'
DESK = '<rect id="desk" class="a b" x="350" y="100" width="80" height="60" stroke="red"/>'
PLACE = (350, 100, 430, 160)


def decoded(body, page=PAGE):
    return decode_svg(f"<svg {NAMESPACES} {page}>{body}</svg>".encode())


def boxes(body, page=PAGE):
    """The boxes of what is drawn beside a shape that always is, y down."""
    drawn = [stroke.points * (1, -1) for stroke in decoded(KEPT + body, page).strokes]
    assert drawn[0][0].tolist() == [10, 20]
    return [(*ring.min(axis=0), *ring.max(axis=0)) for ring in drawn[1:]]


def near(expected):
    return [pytest.approx(each, abs=0.11) for each in expected]


@pytest.mark.parametrize(
    "css",
    [
        ".a{display:none}",
        ".a{DISPLAY: NONE}",
        "#desk{visibility:hidden}",
        "[id^=de]{visibility:collapse}",
        'rect[id="desk"]{display:none}',
        "svg > .a{opacity:0}",
        ".a{opacity:0%}",
        "@media screen{.a{display:none}}",
        "@media only screen {.a{display:none}}",
        "@supports (display:inline){.a{display:none}}",
        "@layer x{.a{display:none}}",
        '@import url("x.css"); .a{display:none}',
        "@namespace s url(http://www.w3.org/2000/svg); s|rect.a{display:none}",
        '@namespace "http://www.w3.org/2000/svg"; rect.a{display:none}',
        ".a{display:none !important} #desk{display:inline}",
        ".b{display:inline} .a{display:none}",
        "rect:not(#none){display:none}",
        "path ~ rect{display:none}",
        "rect:nth-of-type(1){display:none}",
        ":is(.a,.q){display:none}",
        ":root .a{display:none}",
        ".a.b{display:none}",
        "circle, .a, #z{display:none}",
        r".\61{display:none}",
        "/* x */ .a{ /* y */ display /**/ : none; }",
        "rect{fill:none} .a{stroke:none}",
        ".a{fill:transparent;stroke:none}",
        ".a{fill:rgba(1,2,3,0);stroke:none}",
        ".a{fill:#0000;stroke:none}",
        ".a{fill:hsl(120 50% 50% / 0%);stroke:none}",
        ".a{fill:none;stroke-opacity:0}",
        ".a{fill:none;stroke-opacity:0%}",
        ".a{fill:none;stroke-width:0px}",
        ".a{fill:none;stroke:unset}",
        ".a{fill:url(#missing);stroke:none}",
        ".a{color:transparent;fill:currentColor;stroke:none}",
        ":root{--x:none}.a{stroke:none;fill:var(--x)}",
        ":root{--x:var(--y);--y:none}.a{stroke:none;fill:var(--x, red)}",
        ".a{stroke:none;fill:var(--nope, none)}",
        ".a{visibility:hidden!important;visibility:visible}",
    ],
)
def test_a_style_sheet_hides(css):
    assert boxes(f"<style>{css}</style>{DESK}") == []


@pytest.mark.parametrize(
    "css",
    [
        "",
        "@media print{.a{display:none}}",
        ".a{display:none} #desk{display:inline}",
        ".a, :::{display:none}",
        ".a:hover{display:none}",
        ".A{display:none}",
        ".a::before{display:none}",
        ".a{fill:none;stroke-width:0.1}",
        ".a{fill:none} .b{stroke:foo}",
        ".a{stroke:none;fill:foo}",
        ".a{stroke:none;fill:url(#missing) red}",
        ".a{stroke:none;fill:inherit}",
        ".a{fill:none;stroke:initial} #desk{fill:initial}",
        ".a{opacity:0.01}",
        ".a{visibility:nonsense}",
        "@keyframes x{from{opacity:0}}",
        ":root{--x:red}.a{stroke:none;fill:var(--x)}",
        "@namespace s url(urn:other); s|rect.a{display:none}",
        ".a{transform:none}",
        ".a{transform:translate(10,20)}",
        ".a{transform:translate(5px) foo(3)}",
        ".a{transform:translate(5px 6px)}",
        ".a{transform:translateZ(5px)}",
    ],
)
def test_a_style_sheet_does_not_hide_or_move(css):
    assert boxes(f"<style>{css}</style>{DESK}") == [PLACE]


@pytest.mark.parametrize(
    ("style", "expected"),
    [
        ("transform:translate(10px,20px) rotate(30deg)", (233.1, 281.6, 332.4, 373.6)),
        ("transform:translate(1cm,2mm)", (387.8, 107.6, 467.8, 167.6)),
        ("transform:translate(10pt,1in)", (363.3, 196, 443.3, 256)),
        ("transform:translateX(10%)", (430, 100, 510, 160)),
        ("transform:translate3d(10px,20px,0)", (360, 120, 440, 180)),
        ("transform:rotate(.25turn)", (-160, 350, -100, 430)),
        ("transform:rotate(.5rad)", (230.4, 255.6, 329.4, 346.6)),
        ("transform:rotate(50grad)", (134.4, 318.2, 233.3, 417.2)),
        ("transform:matrix(1,.2,.3,1,-100,5)", (280, 175, 378, 251)),
        ("transform:skew(10deg,5deg)", (367.6, 130.6, 458.2, 197.6)),
        ("transform:skewX(10deg)", (367.6, 100, 458.2, 160)),
        ("transform:skewY(10deg)", (350, 161.7, 430, 235.8)),
        ("transform:scaleX(.5) scaleY(2)", (175, 200, 215, 320)),
        ("transform:scale(50%)", (175, 50, 215, 80)),
        ("scale:1 2", (350, 200, 430, 320)),
        (
            "translate:10px 20px;rotate:20deg;scale:1.5;transform:translate(5px)",
            (428.3, 343.1, 571.8, 468.7),
        ),
        ("transform:rotate(90deg);transform-origin:390px 130px", (360, 90, 420, 170)),
        ("transform:scale(.5);transform-origin:center", (375, 200, 415, 230)),
        ("transform:scale(.5);transform-origin:right top", (575, 50, 615, 80)),
        ("transform:scale(.5);transform-origin:bottom left", (175, 350, 215, 380)),
        ("transform:scale(.5);transform-origin:top", (375, 50, 415, 80)),
        ("transform:translate(7px);transform-box:fill-box", (357, 100, 437, 160)),
        (
            "transform:scale(.5);transform-box:fill-box;transform-origin:center",
            (370, 115, 410, 145),
        ),
        ("x:5px;width:13px", (5, 100, 18, 160)),
        ("x:50%", (400, 100, 480, 160)),
    ],
)
def test_css_says_where_a_shape_is(style, expected):
    assert boxes(f"<style>.a{{{style}}}</style>{DESK}") == near([expected])
    assert boxes(DESK.replace("stroke=", f'style="{style}" stroke=')) == near([expected])


SMALL = '<rect x="5" y="5" width="9" height="9"/>'
HERE = (5, 5, 14, 14)
INNER = '<rect x="15" y="15" width="9" height="9"/>'
SYMBOL = '<symbol id="s" viewBox="0 0 10 10"{}><rect x="1" y="1" width="5" height="5"/></symbol>'


@pytest.mark.parametrize(
    ("body", "expected"),
    [
        (f'<g display="none">{DESK}</g>', []),
        (f'<g style="visibility:hidden">{SMALL}</g>', []),
        (f'<g visibility="hidden">{SMALL[:-2]} visibility="visible"/></g>', [HERE]),
        (f'<g opacity="0">{SMALL[:-2]} opacity="1"/></g>', []),
        (f'<g fill="none" stroke="none">{SMALL}{SMALL[:-2]} stroke="red"/></g>', [HERE]),
        (f'<g fill="none">{SMALL[:-2]} fill="foo"/></g>', []),
        (f'{SMALL[:-2]} fill=""/>', [HERE]),
        (f'{SMALL[:-2]} style="display:none !important"/>', []),
        (f'{SMALL[:-2]} fill="red" style="fill:none"/>', []),
        (f'{SMALL[:-2]} fill="none" stroke="red" stroke-width="0%"/>', []),
        (
            f'<switch>{SMALL[:-2]} requiredExtensions="urn:x"/>{INNER}{DESK}</switch>',
            [(15, 15, 24, 24)],
        ),
        (f'<switch>{SMALL[:-2]} systemLanguage="xx"/>{INNER}</switch>', [(15, 15, 24, 24)]),
        (f"<switch><text>desk</text>{SMALL}</switch>", []),
        (f'<svg x="100" y="50" width="200" height="100">{SMALL}</svg>', [(105, 55, 114, 64)]),
        (
            f'<svg x="100" y="50" width="200" height="100" viewBox="10 10 50 50">{INNER}</svg>',
            [(160, 60, 178, 78)],
        ),
        (
            '<svg x="100" y="50" width="200" height="100" viewBox="10 10 50 50" '
            f'preserveAspectRatio="xMinYMin slice">{INNER}</svg>',
            [(120, 70, 156, 106)],
        ),
        (
            '<svg x="100" y="50" width="200" height="100" viewBox="10 10 50 50" '
            f'preserveAspectRatio="xMaxYMax">{INNER}</svg>',
            [(210, 60, 228, 78)],
        ),
        (
            '<svg x="100" y="50" width="200" height="100" viewBox="10 10 50 50" '
            f'preserveAspectRatio="none">{INNER}</svg>',
            [(120, 60, 156, 78)],
        ),
        (
            '<svg x="10%" y="10%" width="50%" height="50%">'
            '<rect x="5%" y="5%" width="50%" height="10%"/></svg>',
            [(100, 75, 300, 105)],
        ),
        (
            '<svg x="10" viewBox="0 0 10 10"><rect x="1" y="1" width="5" height="5"/></svg>',
            [(170, 60, 470, 360)],
        ),
        (
            '<svg x="10" y="10" width="100" height="100" viewBox="0 0 10 10"><svg x="5" y="5" '
            'width="5" height="5" viewBox="0 0 100 100"><circle cx="50" cy="50" r="10"/></svg>'
            "</svg>",
            [(80, 80, 90, 90)],
        ),
        (
            '<svg x="10" y="10" width="100" height="100" transform="translate(50 50)">'
            '<rect width="5" height="5"/></svg>',
            [(60, 60, 65, 65)],
        ),
        (f'<svg width="0" height="10">{SMALL}</svg>', []),
        (f'<svg width="50" height="50" viewBox="0 0 0 10">{SMALL}</svg>', []),
        (f'<svg width="4" height="50">{SMALL}</svg>', []),
        (f'<svg width="4" height="50" overflow="visible">{SMALL}</svg>', [HERE]),
        (
            f'{SYMBOL.format("")}<use href="#s" x="100" y="50" width="200" height="100"/>',
            [(160, 60, 210, 110)],
        ),
        (
            SYMBOL.format(' preserveAspectRatio="xMinYMin"')
            + '<use xlink:href="#s" x="100" y="50" width="200" height="100"/>',
            [(110, 60, 160, 110)],
        ),
        (
            SYMBOL.format(' width="50" height="50"') + '<use href="#s" x="100" y="50"/>',
            [(105, 55, 130, 80)],
        ),
        (
            '<symbol id="s"><rect x="1" y="1" width="5" height="5"/></symbol>'
            '<use href="#s" x="100" y="50"/>',
            [(101, 51, 106, 56)],
        ),
        (
            '<defs><svg id="s" viewBox="0 0 10 10" width="50" height="50">'
            '<rect x="1" y="1" width="5" height="5"/></svg></defs>'
            '<use href="#s" x="100" y="50" width="100" height="100"/>',
            [(110, 60, 160, 110)],
        ),
        (
            '<defs><rect id="s" width="5" height="5"/></defs><use href="#s" x="10%" y="10%"/>',
            [(80, 60, 85, 65)],
        ),
        ('<defs><rect id="s" width="5" height="5"/></defs><use href="#s" fill="none"/>', []),
        (
            '<defs><rect id="s" width="5" height="5"/></defs><use href="#s" visibility="hidden"/>',
            [],
        ),
        (
            f'{SMALL[:-2]} transform="rotate(45)" transform-origin="9.5 9.5"/>',
            [(3.1, 3.1, 15.9, 15.9)],
        ),
        (
            f'{SMALL[:-2]} transform="translate(100)" style="transform:translate(7px)"/>',
            [(12, 5, 21, 14)],
        ),
        (f'{SMALL[:-2]} transform="translate(100)" style="scale:2"/>', [(210, 10, 228, 28)]),
        ('<circle cx="50%" cy="50%" r="10%"/>', [(329.3, 229.3, 470.7, 370.7)]),
        ('<circle cx="50" cy="50" style="r:7px"/>', [(43, 43, 57, 57)]),
        ('<ellipse cx="50" cy="50" rx="10"/>', [(40, 40, 60, 60)]),
        ("<path style=\"d:path('M5 5h9v9h-9z')\"/>", [HERE]),
        ('<rect x="5" y="5" width="auto" height="9"/>', []),
        ('<rect x="5" y="5" width="-4" height="9"/>', []),
        (
            f'<clipPath id="c"><rect width="4" height="4"/></clipPath>'
            f'<g clip-path="url(#c)">{SMALL}</g>',
            [],
        ),
        (
            f'<clipPath id="c"><rect width="6" height="6"/></clipPath>'
            f'<g clip-path="url(#c)">{SMALL}</g>',
            [HERE],
        ),
        (f'<clipPath id="c"/><g clip-path="url(#c)">{SMALL}</g>', []),
        (f'<g clip-path="url(#none)">{SMALL}</g>', [HERE]),
    ],
)
def test_what_a_browser_shows_is_read(body, expected):
    assert boxes(body) == near(expected)


def test_a_drawing_that_is_stretched_as_a_whole_is_read_so():
    stroke = decoded(
        SMALL, 'width="800" height="300" viewBox="0 0 800 600" preserveAspectRatio="none"'
    )
    assert np.ptp(stroke.strokes[0].points, axis=0).tolist() == [9.0, 4.5]
    kept = decoded(SMALL, 'width="800" height="300" viewBox="0 0 800 600"')
    assert np.ptp(kept.strokes[0].points, axis=0).tolist() == [9.0, 9.0]


def test_what_lies_beyond_the_page_is_read():
    assert boxes('<rect x="-90" y="700" width="9" height="9"/>') == [(-90, 700, -81, 709)]


@pytest.mark.parametrize(
    ("body", "words"),
    [
        (
            '<g id="q" style="transform:rotateX(10deg)"/>',
            '(<g id="q"> on line 3 of the file) has a transform that cannot be followed '
            "(rotateX(10deg)); ",
        ),
        (
            '<g style="transform:rotate(calc(1deg + 2deg))"/>',
            "that cannot be followed (rotate(calc(",
        ),
        ('<g style="rotate:x 10deg"/>', "cannot be followed (rotate about an axis)"),
        (
            '<g style="transform:scale(2);transform-box:fill-box"/>',
            "about its own box (transform-box: fill-box)",
        ),
        (
            '<use id="u" href="icons.svg#bed"/>',
            '(<use id="u"> on line 3 of the file) draws something from another file',
        ),
        (
            '<svg id="n" x="wide"/>',
            '(<svg id="n"> on line 3 of the file) has a place or size that is not a length',
        ),
        (
            '<rect id="r" width="5vw" height="3"/>',
            """(<rect id="r">) has width='5vw', which is not a length, on line 3 of the file; """
            "write it in px",
        ),
        ("<style>g{.a{display:none}}</style>", "has a style sheet that has rules within rules"),
    ],
)
def test_what_cannot_be_followed_is_refused_where_it_is(body, words):
    with pytest.raises(InvalidInputError) as caught:
        decoded(f"\n\n{body}{SMALL}")
    assert caught.value.reason == Reason.INVALID_FILE
    assert words in caught.value.problem
    assert "; " in caught.value.problem


def test_a_shape_that_cannot_be_read_is_told_by_its_line():
    with pytest.raises(InvalidInputError) as caught:
        decoded(f'\n<!-- x -->\n{SMALL}\n<path d="garbage"/>')
    assert str(caught.value) == (
        "shapes[1] (<path>) has path data that cannot be read, on line 4 of the file; draw it again"
    )


@pytest.mark.parametrize(
    ("body", "words"),
    [
        (
            "<style>" + ":not(" * 500 + "a" + ")" * 500 + "{fill:none}</style>",
            "is nested too deeply",
        ),
        ("<style>" + "@media screen{" * 2000 + "}" * 2000 + "</style>", "is nested too deeply"),
        (f'<rect style="fill:{"(" * 5000}"/>', "is nested too deeply"),
        ("<style>" + "/**/" * 250_001 + "</style>", "is longer than a million characters"),
        (
            "<style>g g g g g g rect{fill:none}</style>" + "<g>" * 99 + SMALL * 9 + "</g>" * 99,
            "too many rules",
        ),
        ("<style>" + "[a]{fill:red}" * 2000 + "</style>" + "<g/>" * 2000, "too many rules"),
        (
            f"<g style='{';'.join(f'--a{k}:1' for k in range(2000))}'>"
            + "<g style='--b:1'/>" * 2000
            + "</g>",
            "too many custom properties",
        ),
        (
            "<style>rect ~ rect{fill:none}</style>" + "<g/>" * 501,
            "selects elements by their siblings",
        ),
        (
            "<style>:nth-child(2){fill:none}</style>" + "<g/>" * 501,
            "selects elements by their siblings",
        ),
    ],
    ids=range(9),
)
def test_a_style_sheet_meant_to_harm_is_refused(body, words):
    with pytest.raises(InvalidInputError, match=words) as caught:
        decoded(body)
    assert caught.value.problem.endswith("; save it as plain SVG without one")


def test_custom_properties_that_refer_to_each_other_without_end_say_nothing():
    chain = "--a0:red;" + "".join(f"--a{k}:{f'var(--a{k - 1})' * 9};" for k in range(1, 20))
    for said in ("--a19:var(--a19) var(--a19)", chain):
        css = f":root{{{said}}} .a{{fill:var(--a19);stroke:none}}"
        assert boxes(f"<style>{css}</style>{DESK}") == [PLACE], "as if nothing was said"


def test_clips_count_among_the_elements():
    clip = '<clipPath id="c">' + SMALL * 20 + "</clipPath>"
    with limited_to(SourceLimits(max_vertices=1000)), pytest.raises(InvalidInputError) as caught:
        decoded(clip + f'<g clip-path="url(#c)">{SMALL}</g>' * 5)
    assert caught.value.reason == Reason.LIMIT_EXCEEDED


def test_a_share_of_a_page_that_says_no_size_is_refused_with_the_remedy():
    with pytest.raises(InvalidInputError) as caught:
        decoded('<rect width="50%" height="3"/>', "")
    assert caught.value.problem == (
        "(<rect>) has width='50%' of a page without a size, on line 1 of the file; "
        "give <svg> a viewBox"
    )


@pytest.mark.parametrize(
    ("body", "expected"),
    [
        ('<rect x="1em" y="10%" width="5em" height="4ex"/>', (16, 60, 96, 92)),
        (
            '<g font-size="2em"><rect style="width:2em;height:2ch" font-size="50%"/></g>',
            (0, 0, 32, 16),
        ),
        (
            '<symbol id="s"><rect width="9" height="9"/></symbol><use href="#s" x="2em"/>',
            (32, 0, 41, 9),
        ),
        ('<svg y="1em"><rect width="9" height="9"/></svg>', (0, 16, 9, 25)),
    ],
)
def test_lengths_may_be_as_large_as_letters(body, expected):
    assert boxes(body) == [expected]


def test_shares_of_a_page_as_large_as_letters_are_known():
    assert boxes('<rect width="50%" height="50%"/>', 'width="20em" height="10em"') == [
        (0, 0, 160, 80)
    ]


def test_texts_are_where_their_first_letter_is():
    texts = '<text x="50%" y="2em">a</text><text x="3,9" y="4 8" font-size="2em">b</text>'
    found = decoded(KEPT + texts).landmarks
    # A letter is half as wide as it is high.
    assert [(each.point, each.size) for each in found] == [((404, -32), 16), ((11, -4), 32)]


@pytest.mark.parametrize(
    ("text", "x"),
    [
        ('<text x="40">desk</text>', 56),
        ('<text x="40" text-anchor="middle">desk</text>', 40),
        ('<g text-anchor="end"><text><tspan x="40">desk</tspan></text></g>', 24),
        ('<text x="40" style="text-anchor:end; font-size:8px">desk</text>', 32),
        ('<text x="40">一二</text>', 56),  # as wide as high
        ('<text x="40">a kitchen and dining room</text>', 72),  # its beginning
        ('<text x="40" style="writing-mode: tb">desk</text>', 40),
        ('<text x="40" writing-mode="vertical-rl">desk</text>', 40),
        ('<text x="40" text-anchor="nowhere">desk</text>', 56),
    ],
)
def test_a_text_is_in_the_middle_of_its_line(text, x):
    (found,) = decoded(KEPT + text).landmarks
    assert found.point[0] == pytest.approx(x)


def test_a_turned_text_goes_on_where_it_is_turned_to():
    (found,) = decoded(f'{KEPT}<text x="40" transform="rotate(90)">desk</text>').landmarks
    assert found.point == pytest.approx((0.0, -56.0))


@pytest.mark.parametrize(
    ("text", "said", "point"),
    [
        (
            '<text><tspan x="5" y="9">writing</tspan><tspan x="5" y="19">desk</tspan></text>',
            "writing desk",
            (33, -9),
        ),
        (
            '<text x="5" y="9"><tspan>so</tspan><tspan x="8" y="9">fa</tspan></text>',
            "sofa",
            (21, -9),
        ),
        (
            '<text x="5">book<tspan x="5" dy="1em">shelf</tspan><tspan dy="1em">1</tspan></text>',
            "book shelf 1",
            (21, 0),
        ),
        (
            '<text><tspan><tspan x="5" y="9"><tspan>rug</tspan></tspan></tspan></text>',
            "rug",
            (17, -9),
        ),
        (
            '<text x="5" y="9"><title>t</title>a <tspan>big</tspan> bed</text>',
            "a big bed",
            (37, -9),
        ),
    ],
)
def test_the_lines_of_a_text_are_words(text, said, point):
    (found,) = decoded(KEPT + text).landmarks
    assert (found.name, found.point) == (said, point)


# Paper


THINGS = (
    '<rect x="100" y="100" width="200" height="80" fill="none" stroke="black"/>'
    '<circle cx="500" cy="300" r="50" fill="none" stroke="black"/>'
    '<path d="M400 400h90v120h-90z" fill="none" stroke="black"/>'
)


@pytest.mark.parametrize(
    "paper",
    [
        '<rect width="800" height="600" fill="#fff"/>',
        '<path d="M0 0h800v600h-800z" fill="#fff"/>',
        '<polygon points="0,0 800,0 800,600 0,600" fill="beige"/>',
        '<rect width="100%" height="100%" fill="url(#grid)"/><pattern id="grid"/>',
        '<rect x="-50" y="-50" width="900" height="700" rx="9" fill="red"/>',
        '<rect width="8" height="6" transform="scale(100)" style="stroke:#000;stroke-width:0"/>',
        '<rect x="3" y="3" width="794" height="594"/>',
        '<g opacity="0.5"><rect width="800" height="600"/></g>',
        '<rect width="800" height="600" fill="beige"/><rect width="800" height="600" fill="#eee"/>',
        '<rect width="800" height="600" fill="beige"/>'
        '<rect x="9" width="700" height="500" fill="beige"/>',
    ],
)
def test_paper_is_what_covers_the_page_wherever_it_stands(paper):
    for body in (paper + THINGS, f"<defs><rect/></defs>{paper}{THINGS}"):
        found = decoded(body)
        assert (len(found.strokes), found.notes) == (3, ())


@pytest.mark.parametrize(
    ("shape", "count"),
    [
        ('<rect width="800" height="600" fill="none" stroke="red"/>', 4),
        ('<rect width="800" height="300" fill="red"/>', 4),
        ('<circle cx="400" cy="300" r="600" fill="red"/>', 4),
        # White on white is not seen, unless it lies on something.
        ('<rect x="600" width="90" height="90" fill="white"/>', 3),
        ('<rect x="600" width="90" height="90" fill="#fffffe"/>', 4),
        ('<rect x="600" width="90" height="90" fill="white" stroke="red"/>', 4),
        (
            '<rect x="600" width="90" height="90"/>'
            '<rect x="620" width="9" height="9" fill="#fff"/>',
            5,
        ),
        (
            '<rect x="600" width="90" height="90"/>'
            '<rect x="620" y="200" width="9" height="9" fill="#fff"/>',
            4,
        ),
        # Paper leaves a hundredth of the page uncovered at most.
        ('<rect x="7" width="900" height="600"/>', 3),
        ('<rect x="9" width="900" height="600"/>', 4),
        ('<rect y="5" width="800" height="900"/>', 3),
        ('<rect y="7" width="800" height="900"/>', 4),
        ('<rect width="793" height="600"/>', 3),
        ('<rect width="791" height="600"/>', 4),
        ('<rect width="800" height="595"/>', 3),
        ('<rect width="800" height="593"/>', 4),
        ('<path d="M0 0h800v600h-800zM9 9v90h90v-90z"/>', 4),
    ],
)
def test_shapes_that_are_no_paper(shape, count):
    assert len(decoded(THINGS + shape).strokes) == count


def test_a_ground_smaller_than_the_page_is_told_of():
    floor = '<rect id="floor" x="50" y="50" width="700" height="500" fill="beige"/>'
    found = decoded(floor + THINGS)
    assert len(found.strokes) == 3
    assert found.notes == (
        '<rect id="floor"> on line 1 of the file was taken as the paper and left out: all else '
        "lies on it.",
    )
    assert len(decoded(THINGS + floor).strokes) == 4, "it lies over the others"
    assert len(decoded(floor + floor.replace("beige", "red") + THINGS).strokes) == 4, (
        "one is enough"
    )
    assert len(decoded(floor + THINGS[: THINGS.index("<path")]).strokes) == 3, "of two on a table"


@pytest.mark.parametrize(
    "floor",
    [
        'x="150" y="50" width="600" height="500"',
        'x="50" y="150" width="700" height="400"',
        'x="50" y="50" width="490" height="500"',
        'x="50" y="50" width="700" height="460"',
    ],
)
def test_what_something_sticks_out_of_is_no_ground(floor):
    things = THINGS.split("/>")[:3]
    for order in (things, things[::-1]):
        found = decoded(f'<rect {floor} fill="beige"/>{"/>".join(order)}/>')
        assert (len(found.strokes), found.notes) == (4, ())


XKCD = """<g><path d="M0 1L400 2L800 0L799 600L400 598L1 600z" style="fill:#fff;stroke:#fff"/></g>
<path d="M9 9h90v60h-90z" style="fill:none;stroke:#ffffff;stroke-width:5"/>
<path d="M9 9h90v60h-90z" style="fill:none;stroke:#000"/>
<path d="M99 99h600v400h-600z" style="fill:#fff;stroke:#fff"/>
<path d="M300 300h90v60h-90z" fill="red"/>
<path d="M310 310h50" stroke="#fff" fill="none"/>"""


def test_what_is_white_on_white_paper_is_not_seen():
    assert boxes(XKCD) == [(9, 9, 99, 69), (300, 300, 390, 360), (310, 310, 360, 310)]


def test_white_shapes_are_seen_on_dark_ones_that_were_drawn_before():
    tiles = [f'<path d="M{2 * k} 9h1v1h-1z"/>' for k in range(30)]
    dots = [each.replace("1h-1z", '.5h-.5z" fill="#fff').replace("h1", "h.5") for each in tiles]
    dot_on_dot = dots[20].replace("h.5", "h.4")
    assert len(decoded("".join([*dots[25:], *tiles[:20], *dots, dot_on_dot])).strokes) == 40
    assert len(decoded("".join([*tiles, *dots, dot_on_dot])).strokes) == 61


def test_white_lines_on_a_page_that_says_no_colour_are_seen():
    assert boxes('<path d="M9 9h90v60h-90z" fill="none" stroke="#fff"/>') == [(9, 9, 99, 69)]


def test_on_dark_paper_white_is_seen():
    white = '<rect x="600" width="90" height="90" fill="white"/>'
    for page, paper in (
        (PAGE + ' style="background-color:#123"', ""),
        (PAGE, '<rect width="800" height="600" fill="#123"/>'),
    ):
        assert len(decoded(paper + THINGS + white, page).strokes) == 4


def test_a_filling_and_its_line_drawn_apart_are_one():
    filling = '<path fill="#cfe2f3" d="M100 100h200v80h-200z"/>'
    line = '<path id="desk" stroke="#595959" d="M100 100h200v80h-200z" fill="none"/>'
    for body in (filling + line, line + filling):
        (stroke,) = decoded(body).strokes
        assert (stroke.label, stroke.width) == ("desk", 1.0)
    assert len(decoded(filling + line.replace("100h200", "101h200")).strokes) == 2
    assert len(decoded(filling + line.replace("h-200z", "")).strokes) == 2
    assert len(decoded(filling + filling.replace("#cfe2f3", "red")).strokes) == 2


@pytest.mark.parametrize(
    ("paint", "closed"),
    [
        ("", True),
        ('fill="#ccc"', True),
        ('fill="#ccc" stroke="red"', True),
        ('fill="none" stroke="red"', False),
    ],
)
def test_a_filling_closes_what_is_open(paint, closed):
    for shape in (
        '<path d="M620 480h70v70h-70" {}/>',
        '<polyline points="620,480 690,480 690,550 620,550" {}/>',
    ):
        (stroke,) = decoded(shape.format(paint)).strokes
        assert len(stroke.points) == 4 + closed
        assert (stroke.points[0] == stroke.points[-1]).all() == closed


# Labels


@pytest.mark.parametrize(
    ("attributes", "inside"),
    [
        ("", "<title>writing\n      desk</title>"),
        ("", "<title>writing <b>desk</b>\t</title>"),
        ('aria-label="writing&#9;&#10;desk"', "<title> \n </title>"),
        ('data-name="writing  desk"', ""),
        ('xmlns:serif="http://www.serif.com/" serif:id="writing desk" id="writing-desk"', ""),
        ('id="writing&#10;desk"', ""),
    ],
)
def test_labels_have_single_spaces(attributes, inside):
    (stroke,) = decoded(f'<path d="M0 0 1 1" {attributes}>{inside}</path>').strokes
    assert stroke.label == "writing desk"


# Drawings of other tools


FIVE = {
    "desk": (100, 100, 300, 180),
    "shelf": (550, 90, 610, 330),
    "bed": (120, 400, 340, 560),
    "lamp": (620, 480, 690, 550),
    "table": (400, 300, 490, 420),
}


@needs_cases
@pytest.mark.parametrize(
    "name",
    [
        *(f"01-svg-visibility-hidden/{name}" for name in ("attr", "collapse", "group", "style")),
        *(
            f"03-svg-invisible-paint/{n}"
            for n in ("fill-opacity0", "none-none", "opacity0", "style-none")
        ),
        *(f"04-svg-nested-svg/{name}" for name in ("nested-viewbox", "nested-xy")),
        *(f"06-svg-css-transform/{name}" for name in ("class-transform", "style-translate")),
        *(f"10-svg-paper/{n}" for n in ("clip-first", "doubled", "google-drawing", "paper-class")),
        *(f"10-svg-paper/paper-{n}" for n in ("float", "offset-frame", "stroke-width0", "xy")),
        "11-svg-drawio/drawio",
        *(
            f"17-svg-dots-and-taps/dot-{n}"
            for n in ("circle", "h0", "l0", "line", "line2", "polyline", "small", "z")
        ),
    ],
)
def test_five_things_are_found(name):
    found = StrokeSegmenter().segment(read_source(CASES / f"{name}.svg"))
    shown = {item.polygon.bounds: item.label for item in found.scene.objects}
    assert {(x0, -y1, x1, -y0) for x0, y0, x1, y1 in shown} == set(FIVE.values())
    expected = (
        {"", *FIVE} if "doubled" in name or "google" in name or "drawio" in name else set(FIVE)
    )
    assert set(shown.values()) <= expected
    assert len(found.warnings) == ("dot-" in name and "polyline" not in name)


@needs_cases
def test_a_drawing_turned_and_stretched_by_css_is_read_so():
    found = StrokeSegmenter().segment(read_source(CASES / "06-svg-css-transform/style-group.svg"))
    for item in found.scene.objects:
        x0, y0, x1, y1 = FIVE[item.label]
        assert item.polygon.bounds == pytest.approx((-2 * y1, -x1, -2 * y0, -x0))
    assert len(found.scene) == 5


@needs_cases
def test_wrapped_labels_are_one_line():
    strokes = read_source(CASES / "41-label-newline/wrapped-title.svg").strokes
    assert [stroke.label for stroke in strokes] == ["writing desk", "shelf left side", "bed"]


LONG = 100_000


@pytest.mark.parametrize(
    "body",
    [
        f"<style>a{{fill:red}}{'url(data:' * LONG}</style>",
        f"<style media='{' ' * LONG}x'>rect{{fill:none}}</style>",
        f"<style>@media {' ' * LONG}x{{rect{{fill:none}}}}</style>",
        f"<g clip-path='url({' ' * LONG}x'/>",
        f"<g transform-origin='{'1' * LONG}x'/>",
        f"<g opacity='{'1' * LONG}x'/>",
        f"<g stroke-width='{'1' * LONG}x'/>",
    ],
    ids=["data", "media", "at-media", "url", "origin", "share", "length"],
)
def test_a_long_value_is_looked_at_once(body):
    with within(2.0):
        assert boxes(body + DESK)[-1] == near([PLACE])[0]


MARKER = '<marker id="tip"><path d="M0 0L4 2L0 4"/></marker>'
DASHED = '<path class="d" d="M0 0H100" fill="none" stroke="red" {}/>'


@pytest.mark.parametrize(
    ("style", "attributes", "dashed"),
    [
        ("", "", False),
        ("", 'stroke-dasharray="6 4"', True),
        ("", 'stroke-dasharray="6,4,1"', True),
        ("", 'stroke-dasharray="6"', True),
        (".d{stroke-dasharray:6px 4px}", "", True),
        (".d{stroke-dasharray:none}", 'stroke-dasharray="6"', False),
        ("", 'stroke-dasharray="6 -4"', False),  # no legal value
        ("", 'stroke-dasharray="none"', False),
        ("", 'stroke-dasharray="6 0"', False),  # no gaps
        ("", 'stroke-dasharray="0"', False),
        ("", 'stroke-dasharray="100"', False),  # all of it is one dash
        ("", 'stroke-dasharray="60" transform="scale(0.5 2)"', False),
        ("", 'stroke-dasharray="60" transform="scale(3)"', True),
    ],
)
def test_a_line_with_gaps_is_dashed(style, attributes, dashed):
    found = decoded(f"<style>{style}</style>{KEPT}{DASHED.format(attributes)}")
    assert [stroke.dashed for stroke in found.strokes] == [False, dashed]


def test_strokes_are_as_wide_as_their_lines():
    body = (
        '<g stroke="red"><path d="M0 0H99"/><g transform="scale(3)" stroke-width="2">'
        '<path d="M0 9H99"/></g></g><rect width="9" height="7" stroke-width="3"/>'
    )
    assert [each.width for each in decoded(body).strokes] == pytest.approx([1.0, 6.0, 0.0])


@pytest.mark.parametrize(
    ("attributes", "opaque"),
    [
        ('fill="blue"', True),
        ("", True),
        ('fill="currentColor" color="#00f"', True),
        ('fill="none"', False),
        ('fill="rgb(0 0 255 / .9)"', False),
        ('fill="currentColor" color="#00f8"', False),
        ('fill="blue" fill-opacity="0.9"', False),
        ('fill="blue" opacity="0.9"', False),
        ('fill="url(#tip)"', False),
        ('fill="blue" style="stroke:none"', False),
    ],
)
def test_a_filling_that_is_not_seen_through_is_opaque(attributes, opaque):
    shape = f'<rect x="5" y="5" width="60" height="40" stroke="red" {attributes}/>'
    found = decoded(f"{MARKER}{KEPT}{shape}<g opacity='.5'>{shape}</g>")
    assert [each.opaque for each in found.strokes[1:]] == [opaque, False]


def test_a_filling_within_a_dashed_line_has_no_gaps():
    body = (
        '<g stroke="red" stroke-dasharray="2"><line x2="99"/><path d="M0 9H99"/>'
        '<rect width="99" height="70" fill="blue"/><path d="M0 0H99V70" fill="none"/></g>'
    )
    assert [each.dashed for each in decoded(body).strokes] == [True, True, False, True]


LINE = '<path class="d" d="M100 100H300" stroke="red" fill="none" {}/>'


@pytest.mark.parametrize(
    ("style", "attributes", "read"),
    [
        ("", 'marker-start="url(#tip)" marker-end="url(#tip)"', False),
        (".d{marker-start:url(#tip);marker-end:url('#tip')}", "", False),
        (".d{marker-end:url(#tip)}", "", True),
        ("", 'marker-start="url(#none)" marker-end="url(#tip)"', True),
        (".d{marker-start:none}", 'marker-start="url(#tip)" marker-end="url(#tip)"', True),
    ],
)
def test_a_line_with_arrowheads_at_both_ends_says_a_length(style, attributes, read):
    body = f"<style>{style}</style>{MARKER}{KEPT}{LINE.format(attributes)}"
    found = decoded(body)
    assert len(found.strokes) == 1 + read
    where = "<path> on line 1 of the file"
    note = f"{where} was left out as a dimension line: it has arrowheads at both ends."
    assert found.notes == (() if read else (note,))


def test_of_lengths_the_first_is_named_and_outlines_are_none():
    ends = 'marker-start="url(#tip)" marker-end="url(#tip)"'
    lines = '<line x2="9" stroke="red"/><polyline points="0 0 0 9" stroke="red"/>'
    unseen = '<line x2="8" fill="none"/>'
    found = decoded(f"{MARKER}<g {ends}>{DESK}{KEPT}{lines}{unseen}</g>")
    assert len(found.strokes) == 2
    (note,) = found.notes
    assert note.startswith(
        "<line> on line 1 of the file and 1 more were left out as dimension lines"
    )


@pytest.mark.parametrize(
    ("above", "below", "names"),
    [
        ('x="9" y="20"', 'x="9" y="39"', ["master bath"]),
        ('x="9" y="20" id="a"', 'x="9" y="39" id="b"', ["master bath"]),
        ('x="9" y="20"', 'x="10" y="39"', ["master bath"]),
        ('x="9" y="20"', 'x="9" y="50"', ["master", "bath"]),  # too far below
        ('x="9" y="20"', 'x="19" y="39"', ["master", "bath"]),  # aside
        ('x="9" y="39"', 'x="9" y="20"', ["master", "bath"]),  # above
        ('x="9" y="20"', 'x="9" y="39" class="small"', ["master", "bath"]),
        ('x="9" y="20"', 'x="9" y="20"', ["master", "bath"]),
    ],
)
def test_texts_right_below_each_other_are_one_name(above, below, names):
    found = decoded(f"{KEPT}<text {above}>master</text><text {below}>bath</text>")
    assert [item.name for item in found.landmarks] == names
    assert found.landmarks[0].point == (33.0, -float(above.split('"')[3]))


@pytest.mark.parametrize(
    ("lines", "names"),
    [
        (("room", "of", "steam"), ["room of steam"]),
        (("master", "12 m²"), ["master", "12 m²"]),
        (("room 1", "bath"), ["room 1", "bath"]),
    ],
)
def test_names_go_on_for_more_lines_up_to_a_number(lines, names):
    texts = [f'<text x="9" y="{20 * k}">{line}</text>' for k, line in enumerate(lines)]
    found = decoded(KEPT + "".join(texts))
    assert [item.name for item in found.landmarks] == names
    between = decoded(KEPT.join(texts))
    assert [item.name for item in between.landmarks] == [*lines]


@pytest.mark.parametrize(
    ("first", "second", "joined"),
    [("music", "/ office", True), ("kitchen &amp;", "dining", True), ("music", "office", False)],
)
def test_signs_join_lines_of_another_manner(first, second, joined):
    texts = f'<text y="20">{first}</text><text y="50" font-size="12">{second}</text>'
    assert len(decoded(KEPT + texts).landmarks) == (1 if joined else 2)
    small = f'{KEPT}<g transform="scale(0.01)">{texts}</g>'
    assert len(decoded(small).landmarks) == (1 if joined else 2)
    assert len(decoded(KEPT + texts.replace("50", "56")).landmarks) == 2


def test_what_is_written_is_read_where_it_is_seen():
    texts = "".join(
        f'<text x="{k}" y="5" style="{style}">room {k}</text>'
        for k, style in enumerate(
            ("", "display:none", "visibility:hidden", "opacity:0", "fill:red")
        )
    )
    found = decoded(KEPT + texts).landmarks
    assert [(item.name, item.point) for item in found] == [
        ("room 0", (24.0, -5.0)),
        ("room 4", (28.0, -5.0)),
    ]


DIAGRAM = """<rect width="80" height="60" fill="white" stroke="black"/><switch>
<foreignObject width="100%" height="100%"><div xmlns="http://www.w3.org/1999/xhtml">desk</div>
</foreignObject><text x="40" y="34">desk</text></switch>
<rect id="sofa" x="200" width="80" height="60" fill="white" stroke="black"/>
<text x="240" y="34">long one</text>
<circle cx="400" cy="300" r="90" fill="white" stroke="black"/><text x="340" y="390">aside</text>
<switch><g requiredFeatures="x"/><text x="240" y="300">cannot display</text></switch>"""


def test_the_text_in_a_shape_without_a_name_is_its_name():
    scene = StrokeSegmenter().segment(decoded(DIAGRAM)).scene
    assert scene.labels == ("desk", "sofa", "")


HTML = 'xmlns="http://www.w3.org/1999/xhtml"'


@pytest.mark.parametrize(
    ("body", "said", "point", "size"),
    [
        (
            f'<foreignObject x="10" y="20" width="40" height="20"><div {HTML}>desk</div>'
            "</foreignObject>",
            "desk",
            (30, -30),
            16,
        ),
        (  # as Mermaid writes
            '<g transform="translate(100,50)"><foreignObject width="40" height="20">'
            f"<div {HTML}><style>p {{}}</style><span><p>living</p><p>ro<b>om</b></p></span></div>"
            "</foreignObject></g>",
            "living room",
            (120, -60),
            16,
        ),
        (  # as tldraw writes, with large letters
            '<g transform="scale(2)"><foreignObject x="5" y="5" width="10" height="10">'
            f'<div {HTML} style="font-size: 22px">a<br/>b</div></foreignObject></g>',
            "a b",
            (20, -20),
            44,
        ),
        (  # as draw.io writes, with a picture for those who read no HTML
            '<switch><foreignObject width="100%" height="100%">'
            f'<div {HTML} style="margin-left: 9px">bed</div></foreignObject>'
            '<image x="40" y="30" width="20" height="10" xlink:href="data:,"/></switch>',
            "bed",
            (50, -35),
            16,
        ),
    ],
)
def test_what_is_written_as_html_is_read_in_the_middle_of_its_box(body, said, point, size):
    (found,) = decoded(KEPT + body).landmarks
    assert (found.name, found.point, found.size) == (said, point, size)


@pytest.mark.parametrize(
    "box", ['width="100%" height="9"', 'width="x"', 'visibility="hidden" width="9" height="9"']
)
def test_html_that_is_nobody_knows_where_or_not_seen_is_no_name(box):
    body = f"<foreignObject {box}><div {HTML}>desk</div></foreignObject>"
    assert not decoded(KEPT + body).landmarks
