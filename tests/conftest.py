import os

from hypothesis import HealthCheck, settings
from hypothesis.database import DirectoryBasedExampleDatabase

from tests.processes import let_children_be_interrupted

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
settings.register_profile("interpreted", settings.get_profile("same"), max_examples=10)
settings.load_profile("interpreted" if os.environ.get("NUMBA_DISABLE_JIT") == "1" else "same")

let_children_be_interrupted()
