"""The profile ``thesis`` answers bit for bit as the default did before there were judges.

``tests/data/thesis_answers.json`` was written then, by the default: sketches and maps as outlines,
or the files of the example, and what was answered. It is not to be written anew.
"""

import json
from pathlib import Path

import numpy as np
import pytest

from sketchmatch import Scene, match
from sketchmatch.examples import LIVING_ROOM_MAP, LIVING_ROOM_SKETCH

CASES = json.loads((Path(__file__).parents[1] / "data" / "thesis_answers.json").read_text())
EXAMPLES = {"sketch": LIVING_ROOM_SKETCH, "map": LIVING_ROOM_MAP}


def source(case, side):
    outlines = case[side]
    if outlines == "example":
        return EXAMPLES[side]
    return Scene.from_polygons([np.array(outline) for outline in outlines])


def lines(matches):
    """Return lines as JSON has them, which keeps every bit of a float."""
    return [
        [each.sketch_object, each.map_object, each.confidence, each.margin, each.probability]
        for each in matches
    ]


def answered(result):
    return {
        "matches": lines(result.matches),
        "confidence": list(vars(result.confidence).values()),
        "omap_confidence": result.omap_confidence,
        "fmap": [
            [*each.sketch_pair, *each.map_pair, each.similarity, each.rotation, each.dilation]
            for each in result.fmap
        ],
        "rotation": result.rotation,
        "scale": result.scale,
        "outcome": str(result.outcome),
        "upper_bound": result.upper_bound,
        "evaluations": result.statistics.evaluations,
        "iterations": result.statistics.iterations,
        "alternatives": [
            [lines(each.matches), list(vars(each.confidence).values()), each.omap_confidence]
            for each in result.alternatives
        ],
        "search_note": result.search_note,
        "probability": result.probability,
    }


@pytest.mark.parametrize("case", CASES, ids=[case["name"] for case in CASES])
def test_it_answers_bit_for_bit_as_the_default_did(case):
    result = match(source(case, "sketch"), source(case, "map"), profile="thesis", **case["options"])
    assert json.loads(json.dumps(answered(result))) == case["answer"]
