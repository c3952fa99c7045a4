"""What could be right at all: what is counted of each judge, and the table."""

from functools import partial

import pytest

from sketchmatch_builtin.judges.calibration import POSTERIOR
from tests.experiments import ceilings, networks
from tests.experiments.arms import ARMS, Arm
from tests.experiments.ceilings import Tally, main, table, together
from tests.experiments.posterior import known_of
from tests.experiments.runs import each_of
from tests.experiments.training import training_drawing


@pytest.mark.slow
def test_what_a_judge_says_is_counted_and_sketches_that_fit_nowhere_are_too():
    cases = [known for number in range(12) for known in known_of(number)]
    found = Tally.of(cases, POSTERIOR, 15)
    assert found.sketches == 15
    assert found.among == sum(case.right >= 0 for case in cases) >= found.right > 0
    assert len(found.maps) == len(found.places) == len(cases)
    # The place is likelier than any map of it.
    assert all(
        said <= place + 1e-12 for (said, _), place in zip(found.maps, found.places, strict=True)
    )
    for (_, right), number in zip(found.maps, range(12), strict=True):
        assert not right or (training_drawing(number).truth >= 0).any()


def test_a_table_has_a_line_for_each_arm_and_says_of_places_only_what_holds_of_them():
    part, other = ARMS["parts"][0], ARMS["places"][0]
    now = Tally(4, 3, 2, ((0.9, True), (0.9, True), (0.3, False)), (0.9, 0.9, 0.4))
    knows = Tally(4, 3, 3, ((1.0, True), (1.0, True), (1.0, True)), (1.0, 1.0, 0.99))
    found = {(part, "plain"): (now, knows, now), (part, "memory"): (now, knows)}
    third, first, second = table(found | {(other, "plain"): (now, knows)}).rows
    assert third[3:8] == ("99", "75.0", "50.0", "75.0", "50.0")
    assert first[:3] == (part.name, "memory", "4")
    assert first[3:] == (
        "99", "75.0", "50.0", "75.0", "–", "25.0", "0.0", "–", "–", "0.167", "0.000", "0.000",
    )  # fmt: skip
    assert second[:8] == (other.name, "plain", "4", "–", "–", "–", "–", "–")
    assert second[8:12] == ("50.0", "75.0", "0.0", "75.0")


def test_all_arms_of_a_generator_are_counted_together():
    part, more, other = ARMS["parts"][0], ARMS["parts"][1], ARMS["places"][0]
    two = Tally(2, 2, 1, ((0.9, True), (0.9, False)), (0.9, 0.4))
    knows = Tally(2, 2, 2, ((1.0, True), (1.0, True)), (1.0, 1.0))
    away = Tally(2, 0, 0, ((0.3, False),), (0.96,))  # the other one fits nowhere
    found = {
        (part, "plain"): (two, knows, two),
        (other, "plain"): (away, Tally(2, 0, 0, ((0.0, False),), (0.1,))),
        (more, "plain"): (knows, knows, knows),
        (part, "memory"): (two, two),
        (other, "memory"): (away, away),
    }
    columns = [*zip(*together(found).rows, strict=True)]
    assert together(found).header == ("", "plain", "who knows", "memory", "who knows")
    # (|2 * .9 - 1| + |2 * 1 - 2| + .3) / 5
    assert columns[1][:6] == ("100.0", "75.0", "25.0", "50.0", "50.0", "0.220")
    assert columns[2] == ("100.0", "100.0", "0.0", "0.0", "0.0", "0.000", "0.000")
    assert columns[3][:6] == ("100.0", "50.0", "50.0", "50.0", "50.0", "0.367")


@pytest.mark.slow
def test_a_judge_that_knows_is_learned_from_other_sketches_than_are_judged(
    tmp_path, monkeypatch, capsys
):
    arms = (Arm("8 of 8", 8), Arm("8 of another 8", 8, wrong_place=True))
    monkeypatch.setattr(ceilings, "_ARMS", arms)
    monkeypatch.setattr(ceilings, "each_of", partial(each_of, processes=1))
    monkeypatch.setattr(networks, "_EPOCHS", 2)
    few = ["--sketches", "3", "--learned", "6", "--kinds", "plain"]
    main([*few, "--kept", str(tmp_path), "--out", str(tmp_path / "ceilings.md")])
    printed = capsys.readouterr().out
    assert (tmp_path / "ceilings.md").read_text(encoding="utf-8") == printed
    assert sum(line.startswith("| 8 of ") for line in printed.splitlines()) == 2
    kept = {path.stem for path in tmp_path.glob("*.pickle")}
    assert kept == {
        f"plain, {arm.name}-{first}-{first + count}"
        for arm in arms
        for first, count in ((9000, 3), (100_000, 6))
    }
