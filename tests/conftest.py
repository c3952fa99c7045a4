import atexit
import os
import shutil
import tempfile

from hypothesis import HealthCheck, settings
from hypothesis.database import DirectoryBasedExampleDatabase

from tests.interpreted import INTERPRETED, QUICK
from tests.processes import let_children_be_interrupted

# How long an example takes says more of the machine than of the code.
_ANY_MACHINE = {"deadline": None, "suppress_health_check": [HealthCheck.too_slow]}
# The same examples each time: a change fails for its own faults.
settings.register_profile("same", derandomize=True, database=None, **_ANY_MACHINE)
# The first of them; `make test-slow` draws all, as `make test-all` does.
_FIRST = int(QUICK * settings().max_examples)
settings.register_profile("quick", settings.get_profile("same"), max_examples=_FIRST)
# Other examples each time, those that failed first; `make test-all` asks for it.
settings.register_profile(
    "new",
    derandomize=False,
    database=DirectoryBasedExampleDatabase(".hypothesis/examples"),
    print_blob=True,
    **_ANY_MACHINE,
)
settings.load_profile("same" if INTERPRETED else "quick")

let_children_be_interrupted()

# No server of a test's keeps anything in the folder of the person who runs the tests.
os.environ["XDG_STATE_HOME"] = tempfile.mkdtemp(prefix="sketchmatch-state-")
atexit.register(shutil.rmtree, os.environ["XDG_STATE_HOME"], ignore_errors=True)
