"""Built-in histograms, one algorithm a file."""
