"""``sketchmatch serve --web`` from the command line."""

import socket
from contextlib import suppress

import pytest

from tests.processes import sketchmatch


@pytest.mark.slow
def test_web_alone_means_port_8080_of_this_machine_and_says_when_that_is_taken():
    with socket.socket() as taken:
        with suppress(OSError):  # somebody else has it, which does as well
            taken.bind(("127.0.0.1", 8080))
            taken.listen()
        done = sketchmatch("serve", "--address", "127.0.0.1:0", "--workers", "0", "--web")
    (line,) = done.stderr.splitlines()
    assert done.returncode == 2
    assert "server.web_address '127.0.0.1:8080' cannot be listened on" in line
    assert "choose a free port" in line
    assert done.stdout == ""


def test_an_address_that_is_none_is_refused_by_its_name():
    done = sketchmatch("serve", "--web-address", "8080")
    (line,) = done.stderr.splitlines()
    assert done.returncode == 2
    assert "--web-address is '8080'" in line
    assert "should begin with a host, as in 127.0.0.1:8080" in line


@pytest.mark.slow
@pytest.mark.parametrize("address", ["robot.local:9090", "http://robot", "ws://a; script-src *"])
def test_a_robot_that_is_no_web_socket_is_refused_before_it_is_part_of_a_header(address):
    done = sketchmatch("serve", "--web-robots", address)
    (line,) = done.stderr.splitlines()
    assert done.returncode == 2
    assert "--web-robots" in line
    assert "should each be a WebSocket, as in ws://robot.local:9090" in line
