"""Options that several commands share are one list."""

import inspect
from pathlib import Path
from typing import get_args

import pytest
import typer

from sketchmatch.cli.app import app
from sketchmatch.cli.match import match
from sketchmatch.cli.options import Access, Search, asking, to_path
from sketchmatch.cli.transfer import carry, transfer

_TYPED = Search(seed=9)
SEARCH = [
    "searcher",
    "judge",
    "histogram",
    "similarity",
    "seed",
    "time_budget",
    "weights",
    "allow_unmatched",
    "unmatched_price",
]


@pytest.mark.parametrize("command", [match, transfer, carry])
def test_commands_that_match_have_the_same_options_of_search_and_access(command):
    taken = inspect.signature(command).parameters
    for group in (Search, Access):
        own = inspect.signature(group).parameters
        assert [name for name in taken if name in own] == list(own)
        assert all(taken[name].default == own[name].default for name in own)
    assert list(inspect.signature(Search).parameters) == SEARCH


def test_a_command_is_given_its_groups_whole_and_its_own_options_beside():
    @asking
    def command(own: int = 1, search: Search = _TYPED) -> tuple[int, Search]:
        return own, search

    assert command(own=2, seed=3, weights="1,1,1") == (2, Search(seed=3, weights="1,1,1"))
    assert command(own=2) == (2, Search())
    assert "access" not in inspect.signature(command).parameters


def test_the_options_of_a_request_are_those_that_were_typed():
    chosen = Search("exact", "confidence", "force", "overlap", 7, 2.5, "1,2,3", False, 0.5).chosen()
    assert chosen == {
        "searcher": "exact",
        "judge": "confidence",
        "histogram": "force",
        "similarity": "overlap",
        "seed": 7,
        "time_budget": 2.5,
        "weights": (1.0, 2.0, 3.0),
        "allow_unmatched": False,
        "unmatched_price": 0.5,
    }


def commands(of):
    for each in of.registered_commands:
        yield each.callback
    for group in of.registered_groups:
        yield from commands(group.typer_instance)


def test_no_command_takes_an_empty_path_for_the_folder_one_is_in():
    with pytest.raises(typer.BadParameter, match="it is empty; give the path of a file"):
        to_path("")
    assert to_path("a b") == Path("a b")
    taken = [
        hint.__metadata__[0].parser
        for command in commands(app)
        for each in inspect.signature(command, eval_str=True).parameters.values()
        for hint in [each.annotation]
        if Path in (hint.__origin__, *get_args(hint.__origin__))
    ]
    assert len(taken) > 30
    assert set(taken) == {to_path}
