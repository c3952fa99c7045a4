"""Built-in judges, one algorithm a file, and what was learned of right and wrong maps."""
