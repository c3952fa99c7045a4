"""The profile ``thesis`` answers as the default did before there were judges.

``tests/data/thesis_answers.json`` was written then, by the default: sketches and maps as outlines,
or the files of the example, and what was answered. It is not to be written anew. On the kind of
processor that wrote it all bits are the same; libraries add in another order on others, which is
all that may differ here.
"""

import json
import math
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


def ordered(answer):
    """Return an answer with its alternatives that are equally good in an order of their own.

    Where the best is not better than the next, rounding says how many steps the search takes.
    """
    alternatives = sorted(
        answer["alternatives"],
        key=lambda each: (-round(each[1][0], 12), [line[1] for line in each[0]]),
    )
    answer = answer | {"alternatives": alternatives}
    best = round(answer["confidence"][0], 12)
    if alternatives and round(alternatives[0][1][0], 12) >= best:
        answer |= {"evaluations": None, "iterations": None}
    return answer


def differences(found, pinned, where="answer"):
    """Return where an answer is another: numbers by more than rounding, all else at all."""
    if isinstance(found, float) and isinstance(pinned, float):
        alike = math.isclose(found, pinned, rel_tol=1e-13, abs_tol=1e-15)
        return [] if alike else [f"{where}: {found} for {pinned}"]
    if isinstance(found, list) and isinstance(pinned, list) and len(found) == len(pinned):
        found, pinned = dict(enumerate(found)), dict(enumerate(pinned))
    if isinstance(found, dict) and isinstance(pinned, dict) and found.keys() == pinned.keys():
        return [each for k in found for each in differences(found[k], pinned[k], f"{where}.{k}")]
    return [] if found == pinned else [f"{where}: {found} for {pinned}"]


@pytest.mark.parametrize("case", CASES, ids=[case["name"] for case in CASES])
def test_it_answers_as_the_default_did(case):
    result = match(source(case, "sketch"), source(case, "map"), profile="thesis", **case["options"])
    found = json.loads(json.dumps(answered(result)))
    assert not differences(ordered(found), ordered(case["answer"]))
