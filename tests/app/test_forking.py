"""What workers are forked from can be exchanged."""

import multiprocessing.forkserver
import os
import sys

import pytest

from sketchmatch.app.forking import prepare, renew

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="workers are forked on Linux alone")


def test_what_workers_were_forked_from_is_dead_when_it_is_renewed():
    prepare()
    pid = multiprocessing.forkserver._forkserver._forkserver_pid
    renew()
    assert os.waitid(os.P_PID, pid, os.WEXITED | os.WNOHANG | os.WNOWAIT) is not None
    prepare()
    assert multiprocessing.forkserver._forkserver._forkserver_pid != pid
