"""The readers of annotations on pictures: labelme, COCO and CVAT."""

import base64
import io
import json

import numpy as np
import pytest
from PIL import Image

from sketchmatch.api import InvalidInputError
from sketchmatch.io import read_source
from sketchmatch.model import SceneObject
from sketchmatch.model.limits import SourceLimits, limited_to
from sketchmatch_builtin.readers.coco import CocoReader
from sketchmatch_builtin.readers.cvat import CvatReader
from sketchmatch_builtin.readers.labelme import LabelmeReader

L_SHAPE = np.array([[0, 0, 0, 0], [0, 1, 0, 0], [0, 1, 0, 0], [0, 1, 1, 1], [0, 0, 0, 0]])


def objects(found):
    """Return label, area and bounds of each polygon, as a scene would have them."""
    made = [SceneObject.from_rings(polygon.rings, polygon.label) for polygon in found.polygons]
    return [(item.label, item.area, item.polygon.bounds) for item in made]


def labelme(*shapes, part=""):
    return LabelmeReader().read(json.dumps({"version": "5.4", "shapes": shapes}).encode(), part)


def shape(kind, points, label="thing", **more):
    return {"label": label, "shape_type": kind, "points": points, **more}


def png(pixels):
    data = io.BytesIO()
    Image.fromarray((pixels * 255).astype(np.uint8)).save(data, "PNG")
    return base64.b64encode(data.getvalue()).decode()


def test_labelme_shapes_with_an_area_are_objects():
    found = labelme(
        shape("polygon", [[0, 0], [4, 0], [4, 2]], "a"),
        shape("rectangle", [[9, 4], [5, 1]], "b"),
        shape("circle", [[0, 0], [0, 2]], 3),
        {"label": "old", "points": [[0, 0], [4, 0], [4, 2]]},
    )
    (a, b, circle, old) = objects(found)
    assert a == ("a", 4.0, (0, -2, 4, 0))
    assert b == ("b", 12.0, (5, -4, 9, -1))
    assert circle[:2] == ("3", pytest.approx(np.pi * 4, rel=5e-3))
    assert old[0] == "old"
    assert found.notes == ()


def test_labelme_masks_lie_at_their_corner():
    found = labelme(shape("mask", [[10, 20], [13, 24]], "L", mask=png(L_SHAPE)))
    assert objects(found) == [("L", 5.0, (11, -24, 14, -21))]


def test_labelme_shapes_of_one_label_and_group_are_one_object():
    found = labelme(
        shape("polygon", [[0, 0], [4, 0], [4, 4], [0, 4]], "sofa", group_id=0),
        shape("polygon", [[9, 0], [10, 0], [10, 1], [9, 1]], "lamp", group_id=0),
        shape("rectangle", [[4, 0], [6, 4]], "sofa", group_id=0),
        shape("rectangle", [[20, 0], [26, 4]], "sofa", group_id=1),
        shape("rectangle", [[40, 0], [43, 4]], "sofa", group_id=None),
        shape("rectangle", [[50, 0], [52, 4]], "sofa"),
        shape("rectangle", [[0, 9], [9, 99]], "__ignore__"),
    )
    assert [item[:2] for item in objects(found)] == [
        ("sofa", 24.0), ("lamp", 1.0), ("sofa", 24.0), ("sofa", 12.0), ("sofa", 8.0),
    ]  # fmt: skip
    assert found.notes == (
        "Left out because they enclose no area or are not objects: shapes labelled __ignore__ (1).",
    )


def test_labelme_points_and_lines_are_left_out_with_a_note():
    found = labelme(
        shape("line", [[0, 0], [1, 1]]),
        shape("linestrip", [[0, 0], [1, 1]]),
        shape("linestring", [[0, 0], [1, 1]]),
        shape("point", [[0, 0]]),
        shape("polygon", [[0, 0], [1, 1]]),
    )
    assert found.polygons == ()
    assert found.notes == (
        "Left out because they enclose no area or are not objects: lines (3), points (1), "
        "shapes without area (1).",
    )


def test_an_outline_that_crosses_itself_is_its_largest_part():
    found = labelme(shape("polygon", [[0, 0], [6, 6], [6, 0], [0, 1]]))
    assert objects(found)[0][1] == pytest.approx(15.428, abs=1e-3)
    assert found.notes == ("Objects of which only the largest of several parts was taken: 1.",)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"shapes": 3}, "shapes is 3; give a list of shapes"),
        ({"shapes": [3]}, "shapes[0] is 3; give a shape"),
        ({"shapes": [{}]}, "shapes[0].points is missing; give a list of [x, y]"),
        ({"shapes": [shape("polygon", [[0]])]}, "shapes[0].points[0] is a list of 1; give [x, y]"),
        ({"shapes": [shape("circle", [[0, 0]])]}, "is a list of 1; give two points for a circle"),
        ({"shapes": [shape("cone", [])]}, 'shapes[0].shape_type is "cone", which is not known'),
        ({"shapes": [shape("mask", [[0, 0], [1, 1]])]}, "mask is missing; give a picture"),
        (
            {"shapes": [shape("mask", [[0, 0], [1, 1]], mask="AAAA")]},
            "shapes[0].mask is not a picture in base64; save",
        ),
    ],
)
def test_a_fault_of_labelme_is_named_with_its_path(given, words):
    with pytest.raises(InvalidInputError) as caught:
        LabelmeReader().read(json.dumps(given).encode())
    assert words in str(caught.value)


def test_a_kind_without_parts_has_none_to_choose():
    with pytest.raises(
        InvalidInputError, match="has no parts of which 'x' could be one; leave out"
    ):
        labelme(part="x")


def coco(*annotations, part="", images=((1, "a.jpg"),), **more):
    document = {
        "images": [{"id": key, "file_name": name} for key, name in images],
        "categories": [{"id": 7, "name": "bed"}],
        "annotations": [{"image_id": 1, "category_id": 7, **each} for each in annotations],
        **more,
    }
    return CocoReader().read(json.dumps(document).encode(), part)


def test_coco_polygons_boxes_and_masks_are_objects_of_their_category():
    columns = {"size": [5, 4], "counts": [6, 3, 3, 1, 4, 1, 2]}
    found = coco(
        {"segmentation": [[0, 0, 4, 0, 4, 2]]},
        {"segmentation": [[0, 0, 4, 0, 4, 2, 0, 2], [4, 0, 6, 0, 6, 2, 4, 2]]},
        {"segmentation": [], "bbox": [5, 1, 4, 3]},
        {"bbox": [5, 1, 4, 3], "category_id": 99},
        {"segmentation": columns},
    )
    assert objects(found) == [
        ("bed", 4.0, (0, -2, 4, 0)),
        ("bed", 12.0, (0, -2, 6, 0)),
        ("bed", 12.0, (5, -4, 9, -1)),
        ("", 12.0, (5, -4, 9, -1)),
        ("bed", 5.0, (1, -4, 4, -1)),
    ]


def compressed(counts):
    """Return run lengths as COCO's own code writes them."""
    text = ""
    for k, count in enumerate(counts):
        value = count - counts[k - 2] if k > 2 else count
        more = True
        while more:
            bits, value = value & 0x1F, value >> 5
            more = value != (-1 if bits & 0x10 else 0)
            text += chr((bits | 0x20 if more else bits) + 48)
    return text


def test_a_compressed_mask_of_coco_is_the_same_as_a_plain_one():
    mask = np.zeros((70, 90), dtype=int)
    mask[10:60, 20:80] = 1
    mask[20:30, 30:40] = 0
    flat = mask.T.ravel()
    edges = np.flatnonzero(np.diff(flat)) + 1
    counts = np.diff([0, *edges, flat.size]).tolist()
    assert compressed([6, 1, 40]) == "61X1"
    for given in (counts, compressed(counts)):
        ((_, area, bounds),) = objects(coco({"segmentation": {"size": [70, 90], "counts": given}}))
        assert (area, bounds) == (2900.0, (20, -60, 80, -10))


def test_an_object_of_coco_in_two_pieces_is_the_larger_one():
    found = coco({"segmentation": [[0, 0, 4, 0, 4, 2], [9, 9, 10, 9, 10, 10]]})
    assert objects(found) == [("bed", 4.0, (0, -2, 4, 0))]
    assert found.notes == ("Objects of which only the largest of several parts was taken: 1.",)


def test_of_several_pictures_one_is_chosen_by_name_or_id():
    images = [(1, "img/a.jpg"), (2, "b.jpg"), (3, "none.jpg")]
    given = ({"bbox": [0, 0, 1, 1]}, {"bbox": [0, 0, 2, 1], "image_id": 2})
    with pytest.raises(
        InvalidInputError,
        match=r"in 2 pictures; choose one as in FILE#PICTURE: 'img/a.jpg', 'b.jpg'",
    ):
        coco(*given, images=images)
    for part, area in (("b.jpg", 2.0), ("2", 2.0), ("img/a.jpg", 1.0), ("a.jpg", 1.0)):
        assert [item[1] for item in objects(coco(*given, images=images, part=part))] == [area]
    assert coco(*given, images=images, part="none.jpg").polygons == ()
    with pytest.raises(
        InvalidInputError, match=r"has no picture 'c.jpg', or several of that name; choose"
    ):
        coco(*given, images=images, part="c.jpg")


@pytest.mark.parametrize(
    ("annotation", "words"),
    [
        ({}, "annotations[0].bbox is missing; give [x, y, width, height]"),
        ({"bbox": [1, 2]}, "annotations[0].bbox is a list of 2; give"),
        ({"segmentation": [[0, 1, 2]]}, "segmentation[0] has 3 numbers; give an x and a y"),
        ({"segmentation": "x"}, 'segmentation is "x"; give polygons'),
        ({"segmentation": {"counts": []}}, "segmentation.size is missing"),
        ({"segmentation": {"size": [2, 0], "counts": []}}, "size is a list of 2; give [height"),
        ({"segmentation": {"size": [2, 2], "counts": [1, 2]}}, "are of 3 pixels, but the picture"),
        ({"segmentation": {"size": [2, 2], "counts": [5, -1]}}, "are of 4 pixels, but the picture"),
        ({"segmentation": {"size": [2, 2], "counts": "~"}}, "is not a run-length encoding of COCO"),
        ({"segmentation": {"size": [9**9, 9**9], "counts": []}}, "more than the limit of 64"),
    ],
)
def test_a_fault_of_coco_is_named_with_its_path(annotation, words):
    with pytest.raises(InvalidInputError) as caught:
        coco(annotation)
    assert words in str(caught.value)


def cvat(inside, part=""):
    return CvatReader().read(
        f"<annotations><version>1.1</version>{inside}</annotations>".encode(), part
    )


def test_cvat_shapes_with_an_area_are_objects():
    found = cvat(
        '<image id="0" name="a.jpg" width="90" height="90">'
        '<polygon label="a" points="0.0,0.0;4,0;4,2"/>'
        '<box label="b" xtl="5" ytl="1" xbr="9" ybr="4" occluded="0"/>'
        '<box label="turned" xtl="5" ytl="1" xbr="9" ybr="3" rotation="90"/>'
        '<ellipse label="c" cx="0" cy="0" rx="2" ry="1"/>'
        '<mask label="L" rle="1, 1, 3, 1, 3, 3" left="10" top="21" width="4" height="3"/>'
        '<polyline label="d" points="0,0;1,1"/><points label="e" points="0,0"/></image>'
    )
    a, b, turned, c, mask = objects(found)
    assert a == ("a", 4.0, (0, -2, 4, 0))
    assert b == ("b", 12.0, (5, -4, 9, -1))
    assert turned[0] == "turned"
    assert turned[2] == pytest.approx((6, -4, 8, 0))
    assert c[:2] == ("c", pytest.approx(np.pi * 2, rel=5e-3))
    assert mask == ("L", 5.0, (11, -24, 14, -21))
    assert found.notes == (
        "Left out because they enclose no area or are not objects: lines (1), points (1).",
    )


def test_a_frame_of_a_film_in_cvat_is_chosen_by_its_number():
    box = '<box frame="{}" outside="{}" xtl="0" ytl="0" xbr="{}" ybr="1"/>'
    film = (
        '<track id="0" label="bed">'
        + box.format(3, 0, 1)
        + box.format(8, 0, 2)
        + box.format(9, 1, 3)
    )
    film += "</track>"
    assert [item[:2] for item in objects(cvat(film, "8"))] == [("bed", 2.0)]
    with pytest.raises(InvalidInputError, match=r"in 2 pictures; choose one .*: '3', '8'"):
        cvat(film)


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"<annotations", "is not XML (unclosed token"),
        (b"<svg/>", "is XML but not from CVAT: it begins with <svg>"),
        (b'<!DOCTYPE a [<!ENTITY l "<b/>">]><annotations>&l;</annotations>', "defines entities"),
        (b"<annotations>" + b"<g>" * 300, "is nested deeper than the limit"),
        (
            b'<annotations><image><polygon points="a,b"/></image></annotations>',
            'image[0].shape[0].points is "a,b"; give numbers',
        ),
        (
            b'<annotations><image><polygon points="1,2,3"/></image></annotations>',
            'image[0].shape[0].points is "1,2,3"; give numbers',
        ),
        (b"<annotations><image><box/></image></annotations>", 'xtl is ""; give a number'),
        (
            b'<annotations><image><mask rle="1" left="0" top="0" width="2" height="1"/></image>'
            b"</annotations>",
            "rle is of 1 pixels for 2",
        ),
        (
            b'<annotations><image><mask rle="0,2" left="1e300" top="0" width="2" height="1"/>'
            b"</image></annotations>",
            "reaches beyond ±1e+15; use a larger unit",
        ),
        (
            b'<annotations><image><polygon points="0,0;1e300,0;1,1"/></image></annotations>',
            "reaches beyond ±1e+15; use a larger unit",
        ),
    ],
)
def test_a_fault_of_cvat_is_named_with_its_path(data, words):
    with pytest.raises(InvalidInputError) as caught:
        CvatReader().read(data)
    assert words in str(caught.value)


def test_an_xml_of_more_numbers_than_are_allowed_is_refused():
    points = ";".join(["1,2"] * 900)
    with (
        limited_to(SourceLimits(max_vertices=100)),
        pytest.raises(InvalidInputError, match="limit"),
    ):
        cvat(f'<image><polygon points="{points}"/></image>')


def test_files_are_known_by_their_content_or_name(tmp_path):
    (tmp_path / "a.json").write_text(json.dumps({"shapes": [], "imagePath": "a.png"}))
    (tmp_path / "b.json").write_text(json.dumps({"images": [], "annotations": [], "info": {}}))
    (tmp_path / "c.xml").write_text("<annotations/>")
    for name in ("a.json", "b.json", "c.xml"):
        assert read_source(tmp_path / name).polygons == ()


def mask_of_coco(k, width, height):
    size = {"size": [height, width], "counts": [0, width * height]}
    return {"id": k, "image_id": 1, "category_id": 1, "segmentation": size}


def coco_of(annotations):
    return json.dumps({"images": [{"id": 1}], "annotations": annotations}).encode()


def test_a_mask_alike_on_many_lines_costs_as_little_as_one_line():
    with limited_to(SourceLimits(max_vertices=50_000)):
        found = CocoReader().read(coco_of([mask_of_coco(k, 40_000, 900) for k in range(20)]))
    assert len(found.polygons) == 20
    assert objects(found)[0] == ("", 36e6, (0, -900, 40_000, 0))


@pytest.mark.parametrize("reader", [CocoReader, CvatReader])
def test_all_masks_together_may_have_so_many_runs(reader):
    ones = [1] * 400
    if reader is CocoReader:
        of_20 = {"size": [19, 20], "counts": [*ones[:379], 1]}
        data = coco_of([{"image_id": 1, "segmentation": of_20}] * 9)
    else:
        rle = ",".join(map(str, ones[:380]))
        one = f'<mask label="a" left="0" top="0" width="19" height="20" rle="{rle}"/>'
        data = f'<annotations><image id="0">{one * 9}</image></annotations>'.encode()
    with limited_to(SourceLimits(max_vertices=40_000)):
        assert len(reader().read(data).polygons) == 9
    with (
        limited_to(SourceLimits(max_vertices=10_000)),
        pytest.raises(
            InvalidInputError,
            match=r"and those before have .* more than the limit of 10000 vertices",
        ),
    ):
        reader().read(data)


def test_masks_lie_where_their_runs_say():
    pixels = np.random.default_rng(5).random((9, 7)) < 0.7
    pixels[4] = True
    columns = np.flatnonzero(np.diff(pixels.T.ravel(), prepend=False, append=False))
    counts = np.diff(np.concatenate([[0], columns, [pixels.size]])).tolist()
    coco = coco_of([{"image_id": 1, "segmentation": {"size": [9, 7], "counts": counts}}])
    given = labelme(shape("mask", [[0, 0], [6, 8]], "", mask=png(pixels)))
    (first,), (second,) = objects(CocoReader().read(coco)), objects(given)
    assert first[1:] == second[1:]
    assert first[1] <= pixels.sum()


@pytest.mark.slow
@pytest.mark.parametrize("points", [3000, 30_000])
def test_an_outline_that_is_all_crossings_is_refused_at_once(points):
    scribble = np.random.default_rng(0).random((points, 2)).tolist()
    with pytest.raises(InvalidInputError, match="crosses itself more than 10000 times; draw it"):
        labelme(shape("polygon", scribble))


def test_more_shapes_than_a_file_may_have_are_refused_before_they_are_looked_at():
    box = {"image_id": 1, "bbox": [0, 0, 1, 1]}
    with pytest.raises(InvalidInputError, match="has 1001 objects or more, more than the limit"):
        CocoReader().read(coco_of([box] * 5000))
    with (
        limited_to(SourceLimits(max_vertices=4000)),
        pytest.raises(InvalidInputError, match="has 401 shapes"),
    ):
        CocoReader().read(coco_of([box | {"bbox": [0, 0, 0, 0]}] * 401))


def test_a_mask_of_cvat_has_as_many_pixels_as_a_picture_may():
    mask = '<mask label="a" left="0" top="0" width="1000000000" height="1" rle="0,1000000000"/>'
    with pytest.raises(InvalidInputError, match="more than the limit of 64 million pixels"):
        CvatReader().read(f'<annotations><image id="0">{mask}</image></annotations>'.encode())


def test_all_masks_of_labelme_together_have_as_many_pixels_as_a_picture_may():
    mask = shape("mask", [[0, 0], [9, 9]], mask=png(np.ones((10, 10))))
    with limited_to(SourceLimits(max_pixels=300)):
        assert len(labelme(mask, mask, mask).polygons) == 3
        with pytest.raises(InvalidInputError, match="those before have 400 pixels, more than the"):
            labelme(mask, mask, mask, mask)


def test_a_mask_that_is_noise_is_refused_at_once():
    noise = np.random.default_rng(0).random((300, 300)) < 0.5
    with pytest.raises(
        InvalidInputError, match="runs of pixels, more than the limit of 10000; smooth"
    ):
        labelme(shape("mask", [[0, 0], [299, 299]], mask=png(noise)))
