"""What is found on the maps, floors and drawings of the contact sheet, beside counts by eye."""

import pytest

from tests.look import BY_EYE, DATA, found, pictures, sheet
from tests.tools import require


@pytest.mark.slow
@pytest.mark.parametrize("name", BY_EYE)
def test_as_much_is_found_as_was_seen_on_the_sheet(name):
    path = DATA / name
    require(path.exists(), f"the picture {name}")
    _, scene, words = found(path)
    assert scene is not None, words
    assert len(scene) == BY_EYE[name][1]


def test_the_sheet_shows_the_examples_and_what_was_found():
    paths = [path for path in pictures() if path.stem.startswith("living_room")]
    assert [path.name for path in paths] == ["living_room.yaml", "living_room_sketch.svg"]
    shown = sheet(paths)
    assert shown.shape == (300, 2400, 3)
    # Eight objects each, in eight colours of their own.
    for tile in (shown[20:, :300], shown[20:, 300:600]):
        colours = {tuple(colour) for colour in tile.reshape(-1, 3).tolist()}
        assert len([colour for colour in colours if len(set(colour)) > 1]) == 8
