"""Built-in segmenters, one algorithm a file."""
