"""A furnished living room, mapped by a simulated robot and sketched by a simulated hand.

``living_room.yaml`` and ``living_room.pgm`` are the map as ROS map_server keeps it,
``living_room_sketch.svg`` the sketch and ``living_room_truth.json`` says which stroke stands for
what. :mod:`sketchmatch.examples.make_living_room` makes them.
"""

from pathlib import Path

__all__ = ["LIVING_ROOM_MAP", "LIVING_ROOM_SKETCH", "LIVING_ROOM_TRUTH"]

_FOLDER = Path(__file__).resolve().parent

LIVING_ROOM_MAP = _FOLDER / "living_room.yaml"
"""The map: eight pieces of furniture in a room of about 8 × 6 m, 5 cm a cell."""

LIVING_ROOM_SKETCH = _FOLDER / "living_room_sketch.svg"
"""The sketch: one labelled stroke for each of them, all turned by 115° counter-clockwise."""

LIVING_ROOM_TRUTH = _FOLDER / "living_room_truth.json"
"""The truth: for each stroke in drawn order its label and where its object is on the map."""
