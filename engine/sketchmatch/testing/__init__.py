"""What contributors test with: scenes and sketches with known truth."""

from sketchmatch.testing.sketches import SimulatedSketch, simulate_sketch, spacing

__all__ = ["SimulatedSketch", "simulate_sketch", "spacing"]
