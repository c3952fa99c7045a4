"""The engine reads and writes the golden messages about scenes that are kept."""

import pytest

from sketchmatch.app.setup import RequestLimits
from sketchmatch.app.shelf import segmentation
from sketchmatch.errors import InvalidInputError
from tests.contract.conversions import requests, responses
from tests.contract.golden import as_json, as_written, golden
from tests.contract.values import SEGMENTATION, TRACING, plain

NAME, OTHER = "5f2b" * 16, "c07d" * 16


def test_both_sides_of_a_match_may_be_stored_scenes():
    asked = []

    def stored(name, field):
        asked.append((name, field))
        return SEGMENTATION

    read = requests.match_request(golden("MatchRequest.stored"), RequestLimits(), (), stored)
    assert asked == [(NAME, "sketch.stored_scene"), (OTHER, "map.stored_scene")]
    assert read.sketch is read.map is SEGMENTATION


def test_what_is_to_be_kept_is_no_stored_scene():
    source = golden("MatchRequest.stored").sketch
    with pytest.raises(InvalidInputError, match="stored already") as caught:
        requests.source(source, "source", True)
    assert caught.value.field == "source.stored_scene"


def test_a_record_is_written_field_by_field_and_read_as_it_was():
    record = responses.stored_scene(NAME, SEGMENTATION, TRACING)
    assert as_json(record) == as_written("PutSceneResponse")["storedScene"]
    read = segmentation(record)
    assert plain(read) == plain(SEGMENTATION)
    assert read.scene.identity == SEGMENTATION.scene.identity
