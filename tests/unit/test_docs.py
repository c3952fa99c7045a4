"""What the documents show is what the program does."""

import re
import sys
from importlib.metadata import EntryPoint
from importlib.util import module_from_spec, spec_from_file_location

import numpy as np

import sketchmatch
from sketchmatch.model import Scene
from sketchmatch.pipeline.match import Finished, MatchRequest, run_match
from sketchmatch.pipeline.selection import Choice
from sketchmatch.registry import Registry, default_registry, discover
from sketchmatch.testing import simulate_sketch
from tests.tools import ROOT

README = (ROOT / "README.md").read_text(encoding="utf-8")
CONTRIBUTING = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
SCENE = Scene.from_polygons(
    [
        [[0, 0], [2, 0], [2, 1], [0, 1]],
        [[5, 1], [6, 1], [6, 4]],
        [[1, 5], [2, 5], [2, 6], [1, 6]],
        [[7, 7], [9, 7], [8, 8]],
    ]
)


def python_blocks(text):
    return re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)


def test_the_readme_lists_exactly_the_algorithms_there_are():
    listed = set(
        re.findall(r"^\| (segmenter|histogram|similarity|searcher) \| `([^`]+)`", README, re.M)
    )
    registered = {(str(item.kind), item.name) for item in default_registry().algorithms}
    assert listed == registered


def test_the_readme_names_only_attributes_that_a_result_has():
    result = sketchmatch.match(SCENE, SCENE)
    names = re.findall(r"result\.(\w+)", README)
    assert names
    for name in names:
        assert hasattr(result, name), name


def test_the_plugin_of_contributing_works_as_it_stands(tmp_path, monkeypatch):
    (code,) = python_blocks(CONTRIBUTING)
    path = tmp_path / "random_maps.py"
    path.write_text(code, encoding="utf-8")
    spec = spec_from_file_location("random_maps", path)
    monkeypatch.setitem(sys.modules, "random_maps", module := module_from_spec(spec))
    spec.loader.exec_module(module)
    plugin = discover([EntryPoint("random-maps", "random_maps", "sketchmatch")])
    assert [status.failure for status in plugin.statuses] == [""]
    registry = Registry([*default_registry().algorithms, *plugin.algorithms])
    sketch = simulate_sketch(SCENE, np.random.default_rng(5))
    request = MatchRequest(
        sketch.scene, SCENE, {"searcher": Choice("random-maps", {"tries": 300})}, seed=1
    )
    *_, last = run_match(request, registry)
    assert isinstance(last, Finished)
    assert last.result.object_map == dict(enumerate(sketch.partners.tolist()))


def test_every_file_that_the_documents_link_to_exists():
    for name in (
        "README.md",
        "CONTRIBUTING.md",
        "clients/README.md",
        "clients/python/README.md",
        "proto/README.md",
        "plugins/README.md",
    ):
        document = ROOT / name
        links = re.findall(r"\]\((?!https?:|#)([^)#]+)", document.read_text(encoding="utf-8"))
        for link in links:
            assert (document.parent / link).exists(), f"{name} links to {link}"


def test_the_changelog_has_a_section_for_the_version():
    changelog = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert re.search(rf"^## .*{re.escape(sketchmatch.__version__)}", changelog, re.M)
