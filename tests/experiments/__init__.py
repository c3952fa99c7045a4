"""The thesis's experiments on scenes and a simulated user study of our own.

The thesis's figures, and so its scenes and sketches, are not available. What stands in for them:

- ``scenes``: two furnished rooms, A with 8 objects and B with 7, as maps to scale and as occupancy
  grids that a simulated robot makes;
- ``people``: a model of how people draw, calibrated once by ``calibrate``;
- ``study``: the sketches, which go through the real segmenter as pen strokes;
- ``cases``: what is matched with what, and what came of it;
- ``generators``: two other ways to draw, with which is measured and from which nothing is learned;
- ``arms``: parts of maps, things forgotten and invented, other places, and what came of them;
  ``judging`` matches them, ``arm_tables`` counts;
- ``runs``: many cases in two processes;
- ``thesis``: the numbers that the thesis printed;
- ``records``, ``tables``, ``plots``, ``claims``, ``examples``: what is read out of it all, and
  ``report``, a ``document`` of these;
- ``regions``: rooms that people drew of a real building, merged or left out on real floors;
- ``learn``: price and probabilities of the engine, from ``drawings`` that no table is made of, and
  what the judge goes by, from ``training``, ``halls``, ``floors``, ``anyones``, with those of a
  ``crowd``, and ``strangers``;
- ``ceilings``: how much of what the judge gets wrong could be right; ``ceilings.md`` says it.
"""
