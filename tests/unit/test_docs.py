"""What the documents show is what the program does."""

import re

import numpy as np

import sketchmatch
from sketchmatch.api import (
    InvalidInputError,
    Judge,
    JudgedMap,
    Judgement,
    Reader,
    Reason,
    documents,
    hookimpl,
)
from sketchmatch.config.configuration import load
from sketchmatch.io.files import _KINDS, JSON_SUFFIXES
from sketchmatch.model import LabelledPolygon, PolygonSet, Scene
from sketchmatch.registry import OWN_DISTRIBUTION, Kind, default_registry
from sketchmatch.testing import check_plugin
from sketchmatch.testing.conformance.readers import CONTRACTS
from sketchmatch_map_files import PICTURE_SUFFIXES
from tests.pages import page_names
from tests.tools import ROOT

README = (ROOT / "README.md").read_text(encoding="utf-8")
GUIDE = (ROOT / "engine" / "GUIDE.md").read_text(encoding="utf-8")
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


def test_the_guide_lists_exactly_the_algorithms_there_are():
    listed = set(re.findall(rf"^\| ({'|'.join(Kind)}) \| `([^`]+)`", GUIDE, re.M))
    registered = {(str(item.kind), item.name) for item in BUILT_IN}
    assert listed == registered


def test_the_guide_names_the_files_of_every_reader():
    (rows,) = re.findall(r"^\| file \| holds \|\n(.*?)\n\n", GUIDE, re.M | re.S)
    words = {"scene-graph": "Hydra"}
    for item in default_registry().readers:
        for suffix in item.reader.suffixes:
            assert f"`{suffix}`" in rows
        assert words.get(item.name, item.name).lower() in rows.lower()
    for suffix in {*_KINDS, *JSON_SUFFIXES} - {*PICTURE_SUFFIXES}:
        assert f"`{suffix}`" in rows


def test_the_guide_gives_the_defaults_of_the_server():
    server = load(search=False).settings.server
    rows = re.findall(r"^\| `--([a-z-]+)` \| .* \| (\d+)(?: MiB)? \|$", GUIDE, re.M)
    assert rows
    for option, shown in rows:
        name = option.replace("-", "_")
        value = getattr(server, f"{name}_seconds", None) or getattr(server, name)
        assert value == int(shown), option


def test_the_reader_that_is_shown_reads():
    text = CONTRIBUTING.split("\n## Reading files of another kind\n")[1].split("\n## ")[0]
    (block,) = re.findall(r"```python\n(.*?)```", text, re.S)
    names = {
        **{name: getattr(documents, name) for name in documents.__all__},
        **{
            each.__name__: each for each in (Reader, PolygonSet, LabelledPolygon, InvalidInputError)
        },
        "INVALID": Reason.INVALID_POLYGON,
        "np": np,
        "hookimpl": hookimpl,
    }
    exec(block, names)
    (reader,) = names["sketchmatch_register_readers"]()
    found = reader().read(b'{"boxes": [[0, 0, 2, 1]]}')
    assert found.polygons[0].rings[0].tolist() == [[0, 0], [2, 0], [2, 1], [0, 1]]
    for contract in CONTRACTS:
        contract(reader)


def test_the_judge_that_is_shown_keeps_the_contracts():
    text = CONTRIBUTING.split("\n## Judging maps\n")[1].split("\n## ")[0]
    (block,) = re.findall(r"```python\n(.*?)```", text, re.S)
    names = {"Judge": Judge, "JudgedMap": JudgedMap, "Judgement": Judgement, "np": np}
    exec(block, names)
    check_plugin(names["Tidy"])


def test_the_guide_gives_each_algorithm_the_source_that_it_names_itself():
    cells = re.findall(r"^\| \w+ \| `([^`]+)` \| .*? \| (?:([^|]*) )?\|$", GUIDE, re.M)
    sources = {item.name: item.source for item in BUILT_IN}
    assert len(cells) == len(sources)
    for name, short in cells:
        assert bool(short) == bool(sources[name]), name
        for word in set(re.findall(r"[\w.]+", short)) - {"et", "al."}:
            assert word in sources[name], f"{name}: {word}"


def test_the_pages_name_only_attributes_that_a_result_has():
    result = sketchmatch.match(SCENE, SCENE)
    names = re.findall(r"result\.(\w+)", README + GUIDE)
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


def prose_of(document):
    """Return the text of a document without its blocks of code."""
    text = document.read_text(encoding="utf-8")
    return re.sub(r"^(```|~~~).*?^\1$", "", text, flags=re.M | re.S)


def sections_of(document):
    """Return the names by which links reach the sections of a document, in their order."""
    headings = re.findall(r"^#+ (.*)$", prose_of(document), re.M)
    return [re.sub(r"[^\w -]", "", each.lower()).replace(" ", "-") for each in headings]


def test_every_file_and_section_that_the_documents_link_to_exists():
    others = "CONTRIBUTING.md", "SECURITY.md", "engine/RUNNING.md", "plugins/README.md"
    for name in (*page_names(), *others, "plugins/sketchmatch-example-searcher/README.md"):
        document = ROOT / name
        links = re.findall(r"\]\((?!https?:)([^)#]*)#?([^)]*)\)", prose_of(document))
        for link, section in links:
            target = document.parent / link if link else document
            assert target.exists(), f"{name} links to {link}"
            if section:
                page = target / "README.md" if target.is_dir() else target
                assert sections_of(page).count(section) == 1, f"{name} links to {link}#{section}"


def test_the_changelog_has_a_section_for_the_version():
    changelog = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert re.search(rf"^## .*{re.escape(sketchmatch.__version__)}", changelog, re.M)
