"""A pytest plugin for runs against mutants: always the same examples, and none made smaller.

The first run, with nothing changed, writes down how many seconds of the processor each test took.
In later ones those tests alone take part, the quickest of each file first, and the process ends
where one takes far longer than before; the last one begun is written down, too. Interpreted, only
tests take part that are quick even so.
"""

import json
import os
import signal
import time
from contextlib import contextmanager
from pathlib import Path

import pytest
from hypothesis import Phase, settings

from tests.interpreted import INTERPRETED

_QUICK = 0.7
_QUICK_IN_ALL = 15.0
_LEAST_LIMIT = 5.0 if INTERPRETED else 60.0  # kernels compile in between
_PATIENCE = 5.0


@pytest.hookimpl(tryfirst=True)
def pytest_collection(session):
    import sketchmatch

    if session.config.rootpath not in Path(sketchmatch.__file__).parents:
        raise pytest.UsageError("the tests would not see the mutant")
    phases = (Phase.explicit, Phase.generate)
    settings.register_profile("mutants", settings.get_profile("same"), phases=phases)
    settings.load_profile("mutants")


def pytest_configure(config):
    if INTERPRETED:  # where compiled integers wrap around, NumPy's say so
        config.addinivalue_line("filterwarnings", "ignore:overflow encountered:RuntimeWarning")
    if names := os.environ.get("MUTATION_TIMES", ""):
        file, *others = map(Path, names.split(os.pathsep))
        elsewhere = {name for other in others for name in _read(other)}
        config.pluginmanager.register((_Known if file.exists() else _First)(file, elsewhere))


class _First:
    """The run that finds out how long each test takes, without those that other rounds have."""

    def __init__(self, file, elsewhere):
        self._file, self._elsewhere = file, elsewhere
        self._seconds = {}

    @pytest.hookimpl(trylast=True)
    def pytest_collection_modifyitems(self, items):
        items[:] = [item for item in items if item.nodeid not in self._elsewhere]
        if INTERPRETED:
            items[:] = [item for item in items if not item.get_closest_marker("slow")]

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_setup(self):
        with _held(_skip, _QUICK if INTERPRETED else 0.0):
            return (yield)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_call(self, item):
        began = time.process_time()
        with _held(_skip, _QUICK if INTERPRETED else 0.0):
            result = yield
        self._seconds[item.nodeid] = time.process_time() - began
        return result

    def pytest_sessionfinish(self):
        kept, total = {}, 0.0
        for name, seconds in sorted(self._seconds.items(), key=lambda test: test[1]):
            total += seconds
            if not INTERPRETED or total < _QUICK_IN_ALL:
                kept[name] = seconds
        self._file.write_text(json.dumps(kept), encoding="utf-8")


def _read(file):
    return json.loads(file.read_text(encoding="utf-8"))


@contextmanager
def _held(handler, seconds):
    """Call a handler after so many seconds of the processor, if not 0."""
    signal.signal(signal.SIGPROF, handler)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)


def _skip(*_):
    pytest.skip("takes too long where no kernel is compiled")


class _Known:
    """A run of tests whose times are known."""

    def __init__(self, file, elsewhere):
        del elsewhere  # none of these is among the times
        self._last = file.with_suffix(".last")
        self._seconds = _read(file)

    @pytest.hookimpl(trylast=True)
    def pytest_collection_modifyitems(self, items):
        place = {item.path: k for k, item in enumerate(reversed(items))}
        items[:] = [item for item in items if item.nodeid in self._seconds]
        items.sort(key=lambda item: (-place[item.path], self._seconds[item.nodeid]))

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_call(self, item):
        # By its default action the signal ends the process, in the midst of a kernel, too.
        limit = max(_LEAST_LIMIT, _PATIENCE * self._seconds[item.nodeid])
        with _held(signal.SIG_DFL, limit):
            return (yield)

    def pytest_runtest_logstart(self, nodeid):
        self._last.write_text(nodeid, encoding="utf-8")
