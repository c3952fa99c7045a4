"""A server that is used and disturbed for a while answers rightly, and is in the end as it was."""

import pytest

from tests.benchmarks.soak import soaked

pytestmark = pytest.mark.slow


def test_reloads_kills_cancels_and_lost_links_leave_no_trace():
    report = soaked(20.0)
    assert report.faults == []
    for what in (
        "matches answered",
        "matches cancelled",
        "matches left",
        "scenes kept and deleted",
    ):
        assert report.done[what] > 0, report.done
    for what in ("reloads", "workers killed", "cuts of all links"):
        assert report.done[what] >= 3, report.done
