"""How the pictures of results are drawn, from colours up to the page."""
