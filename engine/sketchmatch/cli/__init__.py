"""The command line.

Whatever a command computes in process or asks of a server, it shows as messages of the contract,
so both look the same.
"""

from sketchmatch.cli.app import main

__all__ = ["main"]
