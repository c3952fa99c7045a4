import os

import pytest
from hypothesis import HealthCheck, is_hypothesis_test, settings
from hypothesis.database import DirectoryBasedExampleDatabase

from tests.processes import let_children_be_interrupted

INTERPRETED = os.environ.get("NUMBA_DISABLE_JIT") == "1"
_INTERPRETED_SHARE = 0.2

# How long an example takes says more of the machine than of the code.
_ANY_MACHINE = {"deadline": None, "suppress_health_check": [HealthCheck.too_slow]}
# The same examples each time: a change fails for its own faults.
settings.register_profile("same", derandomize=True, database=None, **_ANY_MACHINE)
# Other examples each time, those that failed first; `make test-all` asks for it.
settings.register_profile(
    "new",
    derandomize=False,
    database=DirectoryBasedExampleDatabase(".hypothesis/examples"),
    print_blob=True,
    **_ANY_MACHINE,
)
# The same ones but fewer, where kernels run as plain Python.
settings.register_profile("interpreted", settings.get_profile("same"), max_examples=20)
settings.load_profile("interpreted" if INTERPRETED else "same")

let_children_be_interrupted()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Let tests that say how many examples they want have fewer of them without the JIT."""
    if not INTERPRETED:
        return
    for test in {item.obj for item in items if is_hypothesis_test(getattr(item, "obj", None))}:
        wanted = test._hypothesis_internal_use_settings
        few = max(3, round(_INTERPRETED_SHARE * wanted.max_examples))
        if wanted.max_examples != settings.default.max_examples:
            test._hypothesis_internal_use_settings = settings(wanted, max_examples=few)
