"""``sketchmatch plugins new``: what it writes works as it stands, and what it refuses."""

import os
import shlex
import subprocess
import sys

import pytest

from sketchmatch.cli import new
from sketchmatch.registry import Kind
from tests.tools import ROOT

# An environment is made and kernels are compiled in it.
pytestmark = [pytest.mark.slow, pytest.mark.timeout(600)]

KINDS = [str(kind) for kind in Kind]
EXAMPLES = ROOT / "engine" / "sketchmatch" / "examples"


@pytest.mark.parametrize("kind", KINDS)
def test_what_it_says_to_do_next_works(kind, clean_shell, tmp_path):
    shell = clean_shell
    shell.run(f"pushd {shlex.quote(str(tmp_path))}")
    made = shell.run(f"sketchmatch plugins new my-{kind} --kind {kind}")
    assert made[0].startswith(f"sketchmatch: wrote the {kind} my-{kind} into sketchmatch-my-{kind}")
    enter, install, check, *use = made[1:]
    shell.run(enter)
    shell.run(f"cp {shlex.quote(str(EXAMPLES))}/living_room* .")
    shell.run("mv living_room_sketch.svg sketch.svg; mv living_room.yaml map.yaml")
    shell.run("sketchmatch segment map.yaml --out map.geojson")
    shell.run(f"{install} --quiet")
    assert "passed" in shell.run(f"{check} -q")[-1]
    shown, used = (shell.run(command) for command in use)
    assert any(f"sketchmatch-my-{kind}" in line for line in shown)
    assert len([line for line in used if line[0].isdigit()]) >= 8
    shell.run("popd")


@pytest.mark.parametrize("kind", KINDS)
def test_what_it_writes_is_clean(kind, command_line, tmp_path):
    assert command_line("plugins", "new", "x-2", "--kind", kind, "--into", tmp_path).returncode == 0
    folder = tmp_path / "sketchmatch-x-2"
    assert (folder / ".gitignore").exists()
    assert not [path for path in folder.rglob("*.[pt][yo]*") if "$" in path.read_text()]
    ruff = [sys.executable, "-m", "ruff"]
    for check in (
        ["check", "--select", "E,F,W,I,B,UP,N,RUF,SIM", "--ignore", "RUF002"],
        ["format"],
    ):
        options = ["--isolated", "--line-length", "100", "--no-cache"]
        if check == ["format"]:
            options.append("--check")
        done = subprocess.run(
            [*ruff, *check, *options, "."], cwd=folder, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stdout


GIVEN = {
    "segmenter": "smallest=0.5",
    "histogram": "width=0.5, directions=90",
    "similarity": "power=2",
    "searcher": "restarts=3",
    "judge": "fit=0.5, sharpness=10",
}


def test_what_it_writes_passes_mypy_strict_where_parameters_are_given(command_line, tmp_path):
    uses = []
    for kind, given in GIVEN.items():
        command_line("plugins", "new", f"x-{kind}", "--kind", kind, "--into", tmp_path)
        name = f"X{kind.capitalize()}{kind.capitalize()}"
        uses += [
            f"from sketchmatch_x_{kind}.{kind} import {name}",
            f"{name}({name}.Params({given})).params.model_dump()",
            f"{name}({name}.Params())",
        ]
    (tmp_path / "use.py").write_text("\n".join(uses), encoding="utf-8")
    # All at once: how one file is checked depends on what was checked before it.
    written = [*tmp_path.glob("*/src"), *tmp_path.glob("*/tests/*.py")]
    ours = (ROOT / "engine", ROOT / "plugins", ROOT / "clients" / "python")
    done = subprocess.run(
        [sys.executable, "-m", "mypy", "--strict", "--explicit-package-bases", "use.py", *written],
        cwd=tmp_path,
        env=os.environ | {"MYPYPATH": os.pathsep.join(map(str, (*tmp_path.glob("*/src"), *ours)))},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.stdout == "Success: no issues found in 16 source files\n", done.stdout


def test_it_writes_into_a_folder_that_is_still_to_be_made(command_line, tmp_path):
    into = tmp_path / "my plugins" / "here"
    done = command_line("plugins", "new", "tabu", "--kind", "searcher", "--into", into)
    assert done.returncode == 0
    assert (into / "sketchmatch-tabu" / "src" / "sketchmatch_tabu" / "searcher.py").exists()
    assert done.stdout.splitlines()[0] == f"cd '{into / 'sketchmatch-tabu'}'"


@pytest.mark.parametrize(
    ("name", "kind", "sentence"),
    [
        *(
            (name, "searcher", f"NAME {name!r} cannot be the name of an algorithm; use up to 40 ")
            for name in ("Tabu", "2-opt", "a--b", "a_b", "../x", "", "x" * 41)
        ),
        ("easm", "searcher", "NAME 'easm' is already a searcher of sketchmatch 0.1.0; "),
        ("client", "searcher", "NAME 'client' would make the package sketchmatch_client, "),
        ("tabu", "sercher", "--kind is 'sercher'; choose one of: segmenter, histogram, "),
    ],
)
def test_what_it_refuses(name, kind, sentence, command_line, tmp_path):
    done = command_line("plugins", "new", name, "--kind", kind, "--into", tmp_path)
    assert done.returncode == 2
    assert done.stderr.startswith(f"sketchmatch: {sentence}")
    assert len(done.stderr.splitlines()) == 1
    assert not list(tmp_path.iterdir())


def test_a_name_of_another_kind_is_free(command_line, tmp_path):
    done = command_line("plugins", "new", "easm", "--kind", "histogram", "--into", tmp_path)
    assert done.returncode == 0


def test_it_never_writes_over_anything(command_line, tmp_path):
    (tmp_path / "sketchmatch-tabu").mkdir()
    done = command_line("plugins", "new", "tabu", "--kind", "searcher", "--into", tmp_path)
    assert done.returncode == 2
    assert "exists already; choose another NAME, or another folder with --into" in done.stderr
    assert not list((tmp_path / "sketchmatch-tabu").iterdir())


def test_a_folder_that_cannot_be_written_is_an_error(command_line, tmp_path):
    (tmp_path / "file").write_bytes(b"")
    done = command_line("plugins", "new", "tabu", "--kind", "searcher", "--into", tmp_path / "file")
    assert done.returncode == 2
    assert "cannot be written (Not a directory); choose another folder" in done.stderr
    assert len(done.stderr.splitlines()) == 1


def test_a_class_never_hides_what_it_derives_from():
    for kind in Kind:
        assert new._values(str(kind), kind)["class_name"] != kind.interface.__name__
