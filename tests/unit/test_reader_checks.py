"""Contracts of readers: each is kept by ours, and broken by a reader with one fault."""

import json

import pytest

from sketchmatch.api import InvalidInputError, Reader, Reason
from sketchmatch.api.documents import decode_text, load_json, no_parts, sequence
from sketchmatch.model import LabelledPolygon, PolygonSet
from sketchmatch.registry import default_registry
from sketchmatch.testing.conformance.contract import CheckState, PluginCheck
from sketchmatch.testing.conformance.readers import CONTRACTS

OURS = [each.reader for each in default_registry().readers]


class Boxes(Reader):
    """Reads boxes."""

    name = "boxes"
    summary = "Boxes."
    keys = ("boxes",)
    source = PolygonSet

    def read(self, data, part=""):
        no_parts(part)
        document = load_json(decode_text(data))
        boxes = document.get("boxes") if isinstance(document, dict) else None
        listed = sequence(boxes, "boxes", Reason.INVALID_POLYGON, "a list of boxes")
        return PolygonSet(tuple(LabelledPolygon((), str(each)) for each in listed))


class WithoutParts(Boxes):
    """Reads boxes."""

    def read(self, data):
        return super().read(data)


class Unsuspecting(Boxes):
    """Reads boxes."""

    def read(self, data, part=""):
        json.loads(data)
        return super().read(data, part)


class Listing(Boxes):
    """Reads boxes."""

    def read(self, data, part=""):
        return list(super().read(data, part).polygons)


class Wordy(Boxes):
    """Reads boxes."""

    def read(self, data, part=""):
        raise InvalidInputError(Reason.INVALID_FILE, part, f"is wrong\nin {len(data)} lines")


class Elsewhere(Boxes):
    """Reads boxes."""

    source = dict


def seen(reader):
    """Return what was seen of the contracts that a reader breaks, by their names."""
    done = (PluginCheck.of(contract, reader, 10.0).result() for contract in CONTRACTS)
    return {each.name: each.seen for each in done if each.state is CheckState.FAILED}


@pytest.mark.parametrize("reader", [Boxes, *OURS], ids=lambda reader: reader.name)
def test_a_sound_reader_keeps_all(reader):
    assert seen(reader) == {}


@pytest.mark.parametrize(
    ("reader", "name", "words"),
    [
        (WithoutParts, "read-takes-a-file-and-a-part", "read(self, data) cannot be called with"),
        (Unsuspecting, "what-is-no-such-file-is-refused", "it raised JSONDecodeError: "),
        (Listing, "what-is-no-such-file-is-refused", "it returned a list"),
        (Wordy, "what-is-no-such-file-is-refused", "of b'', it says 'is wrong\\nin 0 lines'"),
        (Elsewhere, "source-is-known", "source is <class 'dict'>"),
    ],
)
def test_a_fault_is_named(reader, name, words):
    assert words in seen(reader)[name]
