"""What the documents show is what the program does."""

import re

import sketchmatch
from sketchmatch.model import Scene
from sketchmatch.registry import OWN_DISTRIBUTION, default_registry
from tests.tools import ROOT

README = (ROOT / "README.md").read_text(encoding="utf-8")
CONTRIBUTING = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
BUILT_IN = [item for item in default_registry().algorithms if item.distribution == OWN_DISTRIBUTION]
SCENE = Scene.from_polygons(
    [
        [[0, 0], [2, 0], [2, 1], [0, 1]],
        [[5, 1], [6, 1], [6, 4]],
        [[1, 5], [2, 5], [2, 6], [1, 6]],
        [[7, 7], [9, 7], [8, 8]],
    ]
)


def test_the_readme_lists_exactly_the_algorithms_there_are():
    listed = set(
        re.findall(r"^\| (segmenter|histogram|similarity|searcher) \| `([^`]+)`", README, re.M)
    )
    registered = {(str(item.kind), item.name) for item in BUILT_IN}
    assert listed == registered


def test_the_readme_gives_each_algorithm_the_source_that_it_names_itself():
    cells = re.findall(r"^\| \w+ \| `([^`]+)` \| .*? \| (?:([^|]*) )?\|$", README, re.M)
    sources = {item.name: item.source for item in BUILT_IN}
    assert len(cells) == len(sources)
    for name, short in cells:
        assert bool(short) == bool(sources[name]), name
        for word in set(re.findall(r"[\w.]+", short)) - {"et", "al."}:
            assert word in sources[name], f"{name}: {word}"


def test_the_readme_names_only_attributes_that_a_result_has():
    result = sketchmatch.match(SCENE, SCENE)
    names = re.findall(r"result\.(\w+)", README)
    assert names
    for name in names:
        assert hasattr(result, name), name


def test_the_code_of_the_tutorial_is_that_of_the_example():
    source = ROOT / "plugins/sketchmatch-example-searcher/src"
    files = [path.read_text(encoding="utf-8") for path in source.rglob("*.py")]
    tutorial = CONTRIBUTING.split("\n## Adding an algorithm\n")[1].split("\n## ")[0]
    blocks = re.findall(r"```python\n(.*?)```", tutorial, flags=re.DOTALL)
    assert blocks
    for block in blocks:
        assert any(block in file for file in files), block


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
