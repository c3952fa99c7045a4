"""What the caller knows of objects, through every door."""

import json

import pytest

from sketchmatch import Pin as EnginePin
from sketchmatch import match
from sketchmatch.examples import LIVING_ROOM_MAP, LIVING_ROOM_SKETCH
from sketchmatch_client import Client, InvalidRequestError, Pin, sources


@pytest.fixture
def files():
    """Return the example's sketch, whose eight objects have labels, and its map."""
    return LIVING_ROOM_SKETCH, LIVING_ROOM_MAP


@pytest.fixture(params=["in process", "server"])
def where(request):
    if request.param == "in process":
        return []
    return ["--server", request.getfixturevalue("address")]


def lines_of(done):
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    return {
        line.get("sketchObject", 0): line.get("mapObject", 0) for line in result["objectMatches"]
    }


def test_the_command_line_obeys_and_counts_from_one(command_line, files, where):
    known = ("--pin", "Sideboard=3", "--pin", "2=none", "--no-pin", "plant=8", "--allow-unmatched")
    found = lines_of(command_line("match", *files, *known, "--json", *where))
    assert found[0] == 2
    assert 1 not in found
    assert found.get(2) != 7


@pytest.mark.slow
@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (["--pin", "chiar=3"], "--pin chiar=3 names 'chiar', but the labels of the sketch are 'ar"),
        (["--pin", "1=9"], "--pin 1=9 names an object beyond the 8 of the map; name one of these"),
        (
            ["--pin", "sofa=2", "--no-pin", "7=2"],
            "--no-pin 7=2 contradicts --pin sofa=2, which gives the sketched object this partner",
        ),
        (
            ["--pin", "sofa=none", "--no-allow-unmatched"],
            "--pin sofa=none says that the object is not on the map, but every",
        ),
        (
            ["--pin", "sofa=2", "--searcher", "nn"],
            "pins need a searcher that finds one object map, which 'nn'",
        ),
    ],
)
def test_a_contradiction_is_told_as_it_was_typed(command_line, files, where, options, sentence):
    done = command_line("match", *files, *options, *where)
    assert done.returncode == 2
    assert sentence in done.stderr


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (["--pin", "sofa"], "--pin 'sofa' is not of the form SKETCHED=MAPPED, as in desk=3, 2="),
        (["--pin", "a=b=c"], "--pin 'a=b=c' is not of the form"),
        (["--pin", "=3"], "--pin '=3' is not of the form"),
        (["--pin", "0=1"], "--pin '0=1' names object 0; numbers begin at 1"),
        (["--pin", "-2=1"], "--pin '-2=1' names object -2; numbers begin at 1"),
        (["--pin", '""=1'], "--pin '\"\"=1' names no object; give a label or a number"),
        (["--no-pin", "1=None"], "--no-pin '1=None' excludes nothing; name a mapped object"),
        (
            ["--synonyms", "couch"],
            "--synonyms 'couch' is not a list of two or more labels, as in couch,sofa",
        ),
        (["--synonyms", "a,,b"], "--synonyms 'a,,b' is not a list of two or more labels"),
    ],
)
def test_what_has_another_form_is_refused(command_line, files, options, sentence):
    done = command_line("match", *files, *options)
    assert done.returncode == 2
    assert sentence in done.stderr


def test_quotes_make_a_label_of_a_number(command_line, files):
    done = command_line("match", *files, "--pin", '"3"=1')
    assert "names '3', but the labels of the sketch are" in done.stderr


def test_python_and_a_server_give_the_same_answer(address, files):
    sketch, map_ = files
    here = match(sketch, map_, pins=[EnginePin("sofa", 5), EnginePin(0, 6, excluded=True)])
    assert here.object_map[6] == 5
    assert here.object_map.get(0) != 6
    with Client(address) as client:
        asked = sources.file(sketch), sources.map_server_map(map_)
        pins = [Pin("sofa", 5), Pin(0, 6, excluded=True)]
        there = client.match(*asked, pins=pins, synonyms=[("sofa", "couch")])
        assert there.object_map == here.object_map
        assert client.match(*asked, pins={"SOFA": 5}).object_map[6] == 5
        for pins, field, sentence in [
            ({6: 1, 0: 1}, "pins[1].map_object", "is the partner of another sketched object in pi"),
            ({99: 1}, "pins[0].sketch_object", "names an object beyond the 8 of the sketch"),
            ({"": 1}, "pins[0].sketch_object", "is an empty label"),
        ]:
            with pytest.raises(InvalidRequestError) as error:
                client.match(*asked, pins=pins)
            assert error.value.field == field
            assert str(error.value).startswith(f"{field} {sentence}")
        with pytest.raises(InvalidRequestError, match="labels are fewer than two"):
            client.match(*asked, synonyms=[("sofa",)])
