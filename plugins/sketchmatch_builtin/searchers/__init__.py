"""Built-in searchers, one algorithm a file."""
