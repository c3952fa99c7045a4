"""The segmenter of pictures on what is drawn light on dark: boards, masks, negatives."""

import json

import cv2
import numpy as np
import pytest
import shapely

from sketchmatch import match
from sketchmatch.errors import InvalidInputError
from sketchmatch.io import read_source
from sketchmatch.model import Image
from sketchmatch.testing import random_scene
from sketchmatch.testing.photographs import photograph
from sketchmatch_builtin.segmenters.image import ImageSegmenter
from tests.tools import ROOT, require

SKETCHES = ROOT.parent / "shared" / "data" / "sketches"
INVERTED = (
    "The picture is light on dark and was read as its negative: set ink to 'dark' if the dark is "
    "what is drawn."
)
SURROUNDED = (
    "What surrounds the sheet of paper or the board was left out: set frame to 'keep' if it "
    "belongs to the drawing."
)


def found_in(pixels, **params):
    return ImageSegmenter(ImageSegmenter.Params(**params)).segment(Image(pixels))


def rings(found):
    return [item.rings[0].tolist() for item in found.scene.objects]


# Boards ---------------------------------------------------------------------------------------

BOARDS = {
    "plain": {},
    "grey": {"board": 0.35},
    "filled": {"fill": 0.6},
    "gradient": {"gradient": 0.6},
    "vignette": {"vignette": 0.8},
    "shadow": {"shadow": 0.5},
    "lamp": {"glare": 0.35},
    "wiped": {"smear": 0.08},
    "light wall": {"table": 0.7, "perspective": 0.01},
    "dark wall": {"table": 0.03, "perspective": 0.01},
    "all": {"table": 0.6, "gradient": 0.4, "vignette": 0.3, "smear": 0.05, "glare": 0.2},
}


@pytest.mark.parametrize("how", BOARDS)
def test_chalk_on_a_board_is_found_in_any_light(how):
    rng = np.random.default_rng([1, 11])
    options = {"board": 0.15, "pen": 0.007, "noise": 3.0, "darkness": 1.0, "blur": 0.7}
    options |= {"size": (600, 800), **BOARDS[how]}
    picture = photograph(random_scene(rng, 6), rng, **options)
    found = found_in(picture.image.pixels)
    shares = np.array(
        [
            [
                shape.intersection(item.polygon).area / shape.union(item.polygon).area
                for item in found.scene.objects
            ]
            for shape in (shapely.Polygon(outline).buffer(0.0) for outline in picture.outlines)
        ]
    )
    assert shares.shape == (6, 6)
    assert (shares.max(axis=1) > 0.8).all()
    assert found.warnings == (INVERTED, *[SURROUNDED] * ("table" in BOARDS[how]))


# What is ink ----------------------------------------------------------------------------------


def drawing(kind, margin):
    """Six objects, black on white; without a margin some of them touch the picture's border."""
    scene = random_scene(np.random.default_rng([3, 5]), 6)
    x0, y0, x1, y1 = scene.bounds
    scale, margin = 240.0 / (x1 - x0), int(240 * margin)
    size = (int(scale * (y1 - y0)) + 2 * margin + 1, 241 + 2 * margin)
    pixels = np.full(size, 255, np.uint8)
    for item in scene.objects:
        ring = np.rint((item.rings[0] - [x0, y0]) * scale + margin).astype(np.int32)
        if kind == "filled":
            cv2.fillPoly(pixels, [ring], 0)
        else:
            cv2.polylines(pixels, [ring], True, 0, 2 if kind == "thin" else 8)
    return pixels


def lamps(shape):
    y, x = np.mgrid[0 : 1 : shape[0] * 1j, 0 : 1 : shape[1] * 1j]
    return {
        "even": np.ones(shape),
        "slope": 1.0 - 0.5 * x,
        "spot": 0.3 + 0.7 * np.exp(-((x - 0.3) ** 2 + (y - 0.6) ** 2) / 0.1),
        "edge": np.where(x + 0.3 * y > 0.6, 0.5, 1.0),
    }


@pytest.mark.slow
@pytest.mark.parametrize("light", lamps((2, 2)))
@pytest.mark.parametrize("margin", [0.0, 0.1])
@pytest.mark.parametrize("kind", ["thin", "thick", "filled"])
def test_what_is_ink_is_told_from_the_picture(kind, margin, light):
    share = drawing(kind, margin) / 255.0
    lamp = lamps(share.shape)[light]
    noise = np.random.default_rng(0).normal(0.0, 2.0, share.shape)
    for returned, light_on_dark in ((share, False), (0.12 + 0.7 * (1.0 - share), True)):
        pixels = np.clip(240.0 * returned * lamp + noise, 0, 255).astype(np.uint8)
        found = found_in(pixels)
        assert (INVERTED in found.warnings) is light_on_dark
    negative = found_in(255 - pixels)
    assert rings(negative) == rings(found)
    assert INVERTED not in negative.warnings


def test_a_large_filled_box_is_no_board():
    pixels = np.full((300, 400), 255, np.uint8)
    cv2.rectangle(pixels, (50, 50), (250, 260), 0, cv2.FILLED)
    for y in (75, 175):
        cv2.circle(pixels, (310, y), 20, 0, cv2.FILLED)
    for picture, warnings in ((pixels, ()), (255 - pixels, (INVERTED,))):
        found = found_in(picture)
        areas = sorted(item.area for item in found.scene.objects)
        assert areas == pytest.approx([1300, 1300, 201 * 211], rel=0.05)
        assert found.warnings == warnings


def test_a_board_on_a_sheet_and_its_negative_have_the_same_objects():
    pixels = np.full((300, 400), 40, np.uint8)
    pixels[15:285, 20:380] = 230
    pixels[40:260, 50:350] = 60
    for x in (80, 180, 270):
        cv2.rectangle(pixels, (x, 100), (x + 50, 180), 220, 3)
    assert len(rings(found_in(pixels))) == 3
    assert rings(found_in(255 - pixels)) == rings(found_in(pixels))


@pytest.mark.parametrize("ink", ["dark", "light"])
def test_what_is_ink_can_be_said(ink):
    """Two black boxes, each with a white one on it: either may be what was drawn."""
    pixels = np.full((300, 400), 255, np.uint8)
    for x in (20, 210):
        cv2.rectangle(pixels, (x, 30), (x + 169, 269), 0, cv2.FILLED)
        cv2.rectangle(pixels, (x + 50, 100), (x + 99, 149), 255, cv2.FILLED)
    said, opposite = found_in(pixels, ink=ink), {"dark": "light", "light": "dark"}[ink]
    side = {"dark": (170, 240), "light": (50, 50)}[ink]
    assert [tuple(np.ptp(item.rings[0], axis=0)) for item in said.scene.objects] == [side, side]
    assert INVERTED not in said.warnings
    assert rings(found_in(255 - pixels, ink=opposite)) == rings(said)


# What people drew -----------------------------------------------------------------------------


def picture(name):
    path = SKETCHES / name
    require(path.exists(), f"the sketch {name}")
    return read_source(path).pixels


@pytest.mark.parametrize("name", ["00", "01", "02", "03"])
@pytest.mark.parametrize("negative", [False, True])
def test_masks_of_hand_drawn_objects_are_matched_with_their_map_as_people_did(name, negative):
    pictures = [picture(f"objects-taurob/taurob_inv_{which}.png") for which in (name, "model")]
    found = [found_in(255 - pixels if negative else pixels) for pixels in pictures]
    truth = json.loads((SKETCHES / "objects-taurob" / "truth.json").read_text())[name]
    assert [len(each.scene) for each in found] == [len(truth), 6]
    assert all(each.warnings == (INVERTED,) * negative for each in found)
    answer = match(*(each.scene for each in found))
    assert answer.object_map == {int(drawn): mapped for drawn, mapped in truth.items()}


def same_as_negative(pixels):
    answers = []
    for each in (pixels, 255 - pixels):
        try:
            answers.append(rings(found_in(each)))
        except InvalidInputError as error:
            answers.append(str(error))
    return answers[0] == answers[1]


@pytest.mark.slow
@pytest.mark.parametrize("name", [*(f"sketches/{k:02}" for k in range(12)), "model_simple"])
def test_a_floor_plan_gives_objects_or_a_sentence_and_its_negative_the_same(name):
    assert same_as_negative(picture(f"rooms-rsi/{name}.png"))


@pytest.mark.slow
def test_the_plan_of_a_building_and_its_negative_have_the_same_objects():
    plans = sorted((SKETCHES.parent / "floors-ipa").glob("*_furnitures.png"))
    require(plans, "shared/data/floors-ipa")
    for plan in plans:
        assert same_as_negative(read_source(plan).pixels), plan
