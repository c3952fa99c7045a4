"""A pytest plugin for runs against mutants: always the same examples, and none made smaller."""

from pathlib import Path

import pytest
from hypothesis import Phase, settings


@pytest.hookimpl(tryfirst=True)
def pytest_collection(session):
    import sketchmatch

    if session.config.rootpath not in Path(sketchmatch.__file__).parents:
        raise pytest.UsageError("the tests would not see the mutant")
    phases = (Phase.explicit, Phase.generate)
    settings.register_profile("mutants", derandomize=True, database=None, phases=phases)
    settings.load_profile("mutants")
