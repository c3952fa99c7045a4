"""The built-in readers: files of other tools, one kind in a file."""
