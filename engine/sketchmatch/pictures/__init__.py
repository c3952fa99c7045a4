"""Drawings of scenes, matches and relations; ``overlay`` is what others use."""
