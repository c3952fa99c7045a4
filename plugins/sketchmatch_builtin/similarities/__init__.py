"""Built-in similarities, one algorithm a file."""
