"""``python -m sketchmatch``: the command line."""

from sketchmatch.cli import main

main()
