import pytest

from tests.server.harness import serving


@pytest.fixture(scope="session")
def address():
    """Yield the address of a server with the built-in algorithms."""
    with serving() as host:
        yield host.address
