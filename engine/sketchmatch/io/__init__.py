"""Files: what people and robots have on disk, in, and scenes and histograms, out."""

from sketchmatch.io.files import read_source

__all__ = ["read_source"]
