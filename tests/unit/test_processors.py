"""How many processors a process may use."""

import os

import pytest

from sketchmatch.pipeline import processors
from sketchmatch.pipeline.processors import usable_cpus


@pytest.fixture
def machine(tmp_path, monkeypatch):
    """Return what makes a machine of 8 processors whose control groups say something."""

    def make(own="", **files):
        (tmp_path / "own").write_text(own)
        for name, text in files.items():
            file = tmp_path / "groups" / name.replace("__", "/").replace("cpu_", "cpu.")
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(text)

    monkeypatch.setattr(processors, "_OWN", tmp_path / "own")
    monkeypatch.setattr(processors, "_GROUPS", tmp_path / "groups")
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(range(8)), raising=False)
    processors._granted.cache_clear()
    yield make
    processors._granted.cache_clear()


@pytest.mark.parametrize(
    ("own", "files", "expected"),
    [
        ("", {}, 8),
        ("0::/\n", {"cpu_max": "200000 100000\n"}, 2),
        ("0::/\n", {"cpu_max": "max 100000\n"}, 8),
        ("0::/a/b\n", {"a__cpu_max": "150000 100000\n", "a__b__cpu_max": "max 100000\n"}, 2),
        ("0::/a\n", {"a__cpu_max": "20000 100000\n"}, 1),
        ("0::/a\n", {"a__cpu_max": "1600000 100000\n"}, 8),
        ("0::/a\n", {"a__cpu_max": "nonsense"}, 8),
        ("4:cpu:/\n", {"cpu__cpu_cfs_quota_us": "300000", "cpu__cpu_cfs_period_us": "100000"}, 3),
        ("4:cpu:/\n", {"cpu__cpu_cfs_quota_us": "-1", "cpu__cpu_cfs_period_us": "100000"}, 8),
    ],
)
def test_a_process_may_use_what_its_container_is_given(machine, own, files, expected):
    machine(own, **files)
    assert usable_cpus() == expected


def test_a_process_that_is_pinned_may_use_no_more(machine, monkeypatch):
    machine("0::/\n", cpu_max="700000 100000\n")
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {3, 5})
    assert usable_cpus() == 2
