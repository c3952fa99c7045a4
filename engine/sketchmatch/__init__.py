"""Match a hand-drawn sketch of a place with a robot's map of it, object by object."""

__version__ = "0.1.0"
