"""The numbers that the thesis printed, by its tables; facts alone, and where they contradict.

Sketches have the thesis's letters: (a) is the map itself, (b) to (j) show all objects, (k) to (m)
have missing or extra ones. Scene A has 8 objects, scene B has 7.

What does not agree with itself in print:

- Table 4.18 exchanges the ζ and Ω of two rows: the means of appendix B (scene B with the map) are
  0.906 and 0.812, those of appendix C (scene A with the grid) 0.876 and 0.732.
- It counts 62 perfect results and 493 right objects of scene A with the map; appendix A has 61 and
  492, as sketch (d) without object 3 has 6 of 7, with no wrong match named.
- Table 4.11's average, 0.906, is that of all of appendix B; its own rows have 0.922.
- Table 4.15 has 6 right objects for sketch (l), appendix D has 5.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType

__all__ = [
    "AVERAGES",
    "EQUAL",
    "ONE_MISSING",
    "ONE_MISSING_TABLES",
    "SECONDS",
    "SEVERAL_MISSING",
    "SUMMARY",
    "TOTAL",
    "UNEQUAL",
    "Row",
    "Summary",
    "Unequal",
]


@dataclass(frozen=True)
class Row:
    """ζ, Ω and the number of objects correctly matched."""

    zeta: float
    omega: float
    right: int


@dataclass(frozen=True)
class Unequal:
    """A sketch with missing or extra objects, and the wrong matches named: (sketch, map)."""

    row: Row
    wrong: tuple[tuple[int, int], ...] = ()


@dataclass(frozen=True)
class Summary:
    """One line of Table 4.18."""

    tests: int
    objects: int
    perfect: int
    right: int
    zeta: float
    omega: float


EQUAL: MappingProxyType[str, dict[str, Row]] = MappingProxyType(
    {
        "4.1": {
            "a": Row(1.0, 1.0, 8),
            "b": Row(0.881, 0.528, 8),
            "c": Row(0.874, 0.57, 8),
            "d": Row(0.86, 0.519, 6),
            "e": Row(0.909, 0.718, 8),
            "f": Row(0.907, 0.752, 8),
            "g": Row(0.922, 0.694, 8),
            "h": Row(0.904, 0.752, 8),
            "i": Row(0.879, 0.659, 8),
            "j": Row(0.916, 0.737, 8),
        },
        "4.2": {
            "a": Row(1.0, 1.0, 7),
            "b": Row(0.862, 0.614, 5),
            "c": Row(0.871, 0.67, 7),
            "d": Row(0.903, 0.796, 7),
            "e": Row(0.898, 0.732, 7),
            "f": Row(0.869, 0.75, 7),
            "g": Row(0.887, 0.784, 7),
            "h": Row(0.867, 0.732, 7),
            "i": Row(0.877, 0.719, 7),
            "j": Row(0.881, 0.722, 7),
        },
        "4.3": {
            "a": Row(1.0, 1.0, 8),
            "b": Row(0.899, 0.761, 8),
            "c": Row(0.879, 0.743, 8),
            "d": Row(0.867, 0.721, 8),
            "e": Row(0.916, 0.783, 8),
            "f": Row(0.897, 0.758, 8),
            "g": Row(0.913, 0.902, 8),
            "h": Row(0.911, 0.819, 8),
            "i": Row(0.903, 0.77, 8),
            "j": Row(0.926, 0.846, 8),
        },
        "4.4": {
            "a": Row(1.0, 1.0, 7),
            "b": Row(0.908, 0.842, 7),
            "c": Row(0.888, 0.787, 7),
            "d": Row(0.92, 0.835, 7),
            "e": Row(0.907, 0.789, 7),
            "f": Row(0.885, 0.789, 7),
            "g": Row(0.91, 0.808, 7),
            "h": Row(0.885, 0.761, 7),
            "i": Row(0.908, 0.814, 7),
            "j": Row(0.915, 0.809, 7),
        },
        "4.6": {
            "a": Row(1.0, 1.0, 8),
            "b": Row(0.879, 0.714, 8),
            "c": Row(0.879, 0.708, 8),
            "d": Row(0.865, 0.692, 8),
            "e": Row(0.895, 0.728, 8),
            "f": Row(0.888, 0.73, 8),
            "g": Row(0.872, 0.777, 8),
            "h": Row(0.886, 0.734, 8),
            "i": Row(0.899, 0.752, 8),
            "j": Row(0.896, 0.757, 8),
        },
        "4.7": {
            "a": Row(1.0, 1.0, 7),
            "b": Row(0.871, 0.71, 7),
            "c": Row(0.906, 0.817, 7),
            "d": Row(0.932, 0.874, 7),
            "e": Row(0.914, 0.815, 7),
            "f": Row(0.918, 0.86, 7),
            "g": Row(0.928, 0.853, 7),
            "h": Row(0.929, 0.837, 7),
            "i": Row(0.925, 0.855, 7),
            "j": Row(0.909, 0.834, 7),
        },
    }
)
"""Equal numbers of objects: FSNN (4.1, 4.2), EASM (4.3, 4.4), EASM with the grid (4.6, 4.7)."""

AVERAGES: MappingProxyType[str, tuple[float, float]] = MappingProxyType(
    {
        "4.1": (0.905, 0.693),
        "4.2": (0.892, 0.752),
        "4.3": (0.911, 0.81),
        "4.4": (0.913, 0.823),
        "4.6": (0.896, 0.759),
        "4.7": (0.923, 0.845),
        "4.10": (0.913, 0.899),
        "4.11": (0.906, 0.817),
        "4.16": (0.879, 0.776),
        "4.17": (0.932, 0.881),
    }
)
"""ζ and Ω that tables print as their averages, case (a) included."""

SECONDS: MappingProxyType[int, tuple[int, int]] = MappingProxyType(
    {
        3: (1, 1),
        4: (4, 7),
        5: (6, 66),
        6: (12, 359),
        7: (22, 1424),
        8: (37, 4607),
    }
)
"""Table 4.5: seconds of EASM and of FSNN until they converge, by the number of objects."""

UNEQUAL: MappingProxyType[str, dict[str, Unequal]] = MappingProxyType(
    {
        "4.8": {
            "k": Unequal(Row(0.899, 0.769, 5), ((6, 7),)),
            "l": Unequal(Row(0.912, 0.81, 7)),
            "m": Unequal(Row(0.885, 0.739, 7)),
        },
        "4.9": {
            "k": Unequal(Row(0.899, 0.755, 7)),
            "l": Unequal(Row(0.901, 0.782, 6), ((7, 3),)),
            "m": Unequal(Row(0.902, 0.788, 4), ((1, 6),)),
        },
        "4.14": {
            "k": Unequal(Row(0.88, 0.731, 6)),
            "l": Unequal(Row(0.912, 0.81, 7)),
            "m": Unequal(Row(0.866, 0.745, 6), ((3, 7),)),
        },
        "4.15": {
            "k": Unequal(Row(0.916, 0.826, 7)),
            "l": Unequal(Row(0.922, 0.844, 6), ((7, 3),)),
            "m": Unequal(Row(0.902, 0.788, 3), ((2, 6), (3, 4))),
        },
    }
)
"""Sketches (k) to (m): with the map (4.8, 4.9) and the grid (4.14, 4.15), scenes A and B.

In scene A two objects, one and one are missing; in scene B one is extra, one is extra, and two are
missing, as far as the numbers of matched objects tell.
"""

SEVERAL_MISSING: MappingProxyType[str, tuple[Row, ...]] = MappingProxyType(
    {
        "4.12": (
            Row(0.912, 0.792, 7),
            Row(0.902, 0.77, 6),
            Row(0.915, 0.788, 5),
            Row(0.925, 0.832, 4),
            Row(0.94, 0.89, 0),
        ),
        "4.13": (
            Row(0.913, 0.774, 6),
            Row(0.918, 0.791, 5),
            Row(0.923, 0.803, 4),
            Row(0.935, 0.852, 0),
        ),
    }
)
"""Sketch (e) of scenes A and B with 1, 2, … objects missing, on the map."""

ONE_MISSING: MappingProxyType[tuple[str, bool], dict[str, tuple[Row, ...]]] = MappingProxyType(
    {
        ("A", False): {
            "b": (
                Row(0.9, 0.795, 7),
                Row(0.885, 0.767, 7),
                Row(0.89, 0.759, 7),
                Row(0.879, 0.744, 7),
                Row(0.887, 0.754, 7),
                Row(0.893, 0.767, 7),
                Row(0.89, 0.795, 6),
                Row(0.884, 0.758, 7),
            ),
            "c": (
                Row(0.889, 0.772, 7),
                Row(0.892, 0.774, 6),
                Row(0.872, 0.745, 5),
                Row(0.896, 0.853, 7),
                Row(0.872, 0.793, 7),
                Row(0.879, 0.742, 7),
                Row(0.867, 0.757, 6),
                Row(0.879, 0.777, 7),
            ),
            "d": (
                Row(0.864, 0.723, 7),
                Row(0.867, 0.725, 6),
                Row(0.873, 0.753, 6),
                Row(0.902, 0.827, 7),
                Row(0.849, 0.712, 7),
                Row(0.863, 0.742, 7),
                Row(0.861, 0.743, 6),
                Row(0.865, 0.746, 7),
            ),
            "e": (
                Row(0.912, 0.792, 7),
                Row(0.902, 0.769, 7),
                Row(0.916, 0.793, 7),
                Row(0.908, 0.79, 7),
                Row(0.906, 0.776, 7),
                Row(0.909, 0.765, 7),
                Row(0.905, 0.772, 7),
                Row(0.909, 0.798, 7),
            ),
            "f": (
                Row(0.907, 0.802, 7),
                Row(0.912, 0.78, 7),
                Row(0.89, 0.765, 7),
                Row(0.884, 0.787, 7),
                Row(0.867, 0.754, 7),
                Row(0.9, 0.792, 7),
                Row(0.892, 0.786, 6),
                Row(0.889, 0.764, 7),
            ),
            "g": (
                Row(0.915, 0.9, 7),
                Row(0.908, 0.898, 6),
                Row(0.913, 0.901, 7),
                Row(0.927, 0.903, 7),
                Row(0.917, 0.912, 7),
                Row(0.903, 0.892, 7),
                Row(0.916, 0.882, 6),
                Row(0.906, 0.906, 7),
            ),
            "h": (
                Row(0.914, 0.835, 7),
                Row(0.913, 0.831, 7),
                Row(0.9, 0.801, 7),
                Row(0.924, 0.869, 7),
                Row(0.906, 0.821, 7),
                Row(0.894, 0.785, 7),
                Row(0.899, 0.793, 7),
                Row(0.9, 0.806, 7),
            ),
            "i": (
                Row(0.894, 0.766, 7),
                Row(0.907, 0.795, 7),
                Row(0.903, 0.802, 7),
                Row(0.903, 0.77, 7),
                Row(0.893, 0.751, 7),
                Row(0.894, 0.768, 7),
                Row(0.896, 0.759, 7),
                Row(0.9, 0.795, 6),
            ),
            "j": (
                Row(0.919, 0.842, 7),
                Row(0.929, 0.86, 7),
                Row(0.917, 0.82, 7),
                Row(0.913, 0.822, 7),
                Row(0.935, 0.903, 7),
                Row(0.918, 0.842, 7),
                Row(0.912, 0.829, 7),
                Row(0.917, 0.842, 7),
            ),
        },
        ("B", False): {
            "b": (
                Row(0.906, 0.823, 6),
                Row(0.917, 0.874, 6),
                Row(0.907, 0.87, 6),
                Row(0.921, 0.854, 6),
                Row(0.92, 0.86, 6),
                Row(0.902, 0.816, 6),
                Row(0.872, 0.786, 6),
            ),
            "c": (
                Row(0.917, 0.847, 5),
                Row(0.873, 0.767, 6),
                Row(0.905, 0.824, 6),
                Row(0.886, 0.813, 6),
                Row(0.882, 0.826, 6),
                Row(0.924, 0.855, 6),
                Row(0.918, 0.873, 6),
            ),
            "d": (
                Row(0.913, 0.856, 5),
                Row(0.924, 0.843, 6),
                Row(0.919, 0.81, 6),
                Row(0.913, 0.812, 6),
                Row(0.918, 0.83, 6),
                Row(0.925, 0.856, 6),
                Row(0.94, 0.887, 6),
            ),
            "e": (
                Row(0.912, 0.773, 6),
                Row(0.913, 0.801, 6),
                Row(0.907, 0.771, 6),
                Row(0.913, 0.798, 6),
                Row(0.914, 0.809, 6),
                Row(0.908, 0.788, 6),
                Row(0.909, 0.789, 6),
            ),
            "f": (
                Row(0.891, 0.789, 6),
                Row(0.881, 0.802, 6),
                Row(0.903, 0.82, 6),
                Row(0.879, 0.771, 5),
                Row(0.882, 0.83, 6),
                Row(0.88, 0.789, 6),
                Row(0.881, 0.799, 6),
            ),
            "g": (
                Row(0.92, 0.821, 6),
                Row(0.923, 0.839, 6),
                Row(0.908, 0.798, 5),
                Row(0.908, 0.789, 6),
                Row(0.912, 0.803, 6),
                Row(0.909, 0.805, 6),
                Row(0.909, 0.815, 6),
            ),
            "h": (
                Row(0.888, 0.727, 6),
                Row(0.879, 0.794, 5),
                Row(0.889, 0.787, 6),
                Row(0.894, 0.767, 6),
                Row(0.891, 0.762, 6),
                Row(0.892, 0.805, 6),
                Row(0.875, 0.73, 6),
            ),
            "i": (
                Row(0.904, 0.819, 6),
                Row(0.92, 0.841, 6),
                Row(0.91, 0.836, 5),
                Row(0.917, 0.82, 6),
                Row(0.906, 0.824, 6),
                Row(0.905, 0.809, 6),
                Row(0.902, 0.791, 6),
            ),
            "j": (
                Row(0.929, 0.852, 6),
                Row(0.914, 0.806, 6),
                Row(0.928, 0.846, 6),
                Row(0.907, 0.774, 6),
                Row(0.907, 0.772, 5),
                Row(0.921, 0.822, 6),
                Row(0.91, 0.778, 6),
            ),
        },
        ("A", True): {
            "b": (
                Row(0.881, 0.73, 7),
                Row(0.866, 0.732, 7),
                Row(0.876, 0.735, 7),
                Row(0.86, 0.709, 7),
                Row(0.861, 0.7, 7),
                Row(0.877, 0.749, 7),
                Row(0.859, 0.74, 6),
                Row(0.85, 0.672, 7),
            ),
            "c": (
                Row(0.887, 0.742, 7),
                Row(0.877, 0.738, 6),
                Row(0.864, 0.676, 7),
                Row(0.873, 0.74, 7),
                Row(0.864, 0.683, 7),
                Row(0.868, 0.702, 7),
                Row(0.867, 0.683, 7),
                Row(0.87, 0.696, 7),
            ),
            "d": (
                Row(0.868, 0.707, 7),
                Row(0.835, 0.656, 6),
                Row(0.869, 0.713, 7),
                Row(0.854, 0.721, 7),
                Row(0.844, 0.666, 7),
                Row(0.852, 0.691, 7),
                Row(0.833, 0.648, 6),
                Row(0.855, 0.712, 7),
            ),
            "e": (
                Row(0.892, 0.754, 7),
                Row(0.879, 0.725, 7),
                Row(0.88, 0.744, 7),
                Row(0.882, 0.732, 7),
                Row(0.882, 0.708, 7),
                Row(0.889, 0.738, 7),
                Row(0.878, 0.712, 7),
                Row(0.879, 0.702, 7),
            ),
            "f": (
                Row(0.88, 0.782, 7),
                Row(0.871, 0.724, 7),
                Row(0.869, 0.701, 7),
                Row(0.878, 0.742, 7),
                Row(0.871, 0.696, 7),
                Row(0.881, 0.754, 7),
                Row(0.877, 0.724, 7),
                Row(0.871, 0.72, 7),
            ),
            "g": (
                Row(0.885, 0.802, 7),
                Row(0.88, 0.792, 7),
                Row(0.882, 0.797, 7),
                Row(0.897, 0.801, 7),
                Row(0.871, 0.776, 7),
                Row(0.865, 0.754, 7),
                Row(0.872, 0.731, 6),
                Row(0.881, 0.761, 7),
            ),
            "h": (
                Row(0.882, 0.735, 7),
                Row(0.885, 0.736, 7),
                Row(0.875, 0.715, 7),
                Row(0.89, 0.773, 7),
                Row(0.877, 0.731, 7),
                Row(0.876, 0.722, 7),
                Row(0.875, 0.729, 7),
                Row(0.864, 0.701, 7),
            ),
            "i": (
                Row(0.89, 0.742, 7),
                Row(0.893, 0.747, 7),
                Row(0.898, 0.773, 7),
                Row(0.888, 0.734, 7),
                Row(0.892, 0.752, 7),
                Row(0.884, 0.729, 7),
                Row(0.898, 0.775, 7),
                Row(0.892, 0.749, 6),
            ),
            "j": (
                Row(0.895, 0.783, 6),
                Row(0.899, 0.781, 7),
                Row(0.885, 0.76, 7),
                Row(0.881, 0.739, 7),
                Row(0.894, 0.784, 7),
                Row(0.883, 0.744, 7),
                Row(0.88, 0.745, 7),
                Row(0.876, 0.732, 7),
            ),
        },
        ("B", True): {
            "b": (
                Row(0.874, 0.68, 6),
                Row(0.885, 0.738, 6),
                Row(0.874, 0.676, 5),
                Row(0.886, 0.712, 6),
                Row(0.892, 0.758, 6),
                Row(0.894, 0.746, 6),
                Row(0.897, 0.769, 6),
            ),
            "c": (
                Row(0.922, 0.823, 5),
                Row(0.901, 0.83, 6),
                Row(0.904, 0.811, 6),
                Row(0.9, 0.796, 6),
                Row(0.907, 0.828, 6),
                Row(0.918, 0.825, 4),
                Row(0.892, 0.805, 6),
            ),
            "d": (
                Row(0.922, 0.876, 5),
                Row(0.932, 0.868, 6),
                Row(0.94, 0.89, 6),
                Row(0.942, 0.893, 6),
                Row(0.932, 0.888, 6),
                Row(0.918, 0.856, 6),
                Row(0.935, 0.898, 6),
            ),
            "e": (
                Row(0.911, 0.823, 6),
                Row(0.881, 0.83, 6),
                Row(0.914, 0.811, 6),
                Row(0.932, 0.796, 6),
                Row(0.907, 0.828, 6),
                Row(0.912, 0.825, 6),
                Row(0.932, 0.805, 6),
            ),
            "f": (
                Row(0.91, 0.792, 6),
                Row(0.891, 0.804, 6),
                Row(0.903, 0.83, 6),
                Row(0.922, 0.812, 6),
                Row(0.905, 0.83, 6),
                Row(0.902, 0.789, 6),
                Row(0.934, 0.825, 6),
            ),
            "g": (
                Row(0.922, 0.846, 6),
                Row(0.931, 0.886, 6),
                Row(0.906, 0.778, 6),
                Row(0.921, 0.814, 6),
                Row(0.919, 0.831, 6),
                Row(0.921, 0.8, 6),
                Row(0.906, 0.792, 6),
            ),
            "h": (
                Row(0.908, 0.742, 6),
                Row(0.892, 0.774, 5),
                Row(0.877, 0.781, 6),
                Row(0.884, 0.81, 6),
                Row(0.901, 0.792, 6),
                Row(0.89, 0.825, 6),
                Row(0.876, 0.766, 6),
            ),
            "i": (
                Row(0.916, 0.824, 6),
                Row(0.928, 0.817, 6),
                Row(0.902, 0.802, 5),
                Row(0.904, 0.797, 6),
                Row(0.911, 0.81, 6),
                Row(0.912, 0.792, 6),
                Row(0.892, 0.804, 6),
            ),
            "j": (
                Row(0.929, 0.852, 6),
                Row(0.914, 0.806, 6),
                Row(0.928, 0.846, 6),
                Row(0.907, 0.774, 6),
                Row(0.907, 0.772, 5),
                Row(0.921, 0.822, 6),
                Row(0.91, 0.778, 6),
            ),
        },
    }
)
"""Appendices A to D: by scene and grid or not, and by sketch: EASM without object 1, 2, …"""

ONE_MISSING_TABLES: MappingProxyType[str, tuple[str, bool, str]] = MappingProxyType(
    {
        "4.10": ("A", False, "g"),
        "4.11": ("B", False, "d"),
        "4.16": ("A", True, "g"),
        "4.17": ("B", True, "d"),
    }
)
"""The sketches of ONE_MISSING that tables 4.10, 4.11, 4.16 and 4.17 show: scene, grid, sketch."""

SUMMARY: MappingProxyType[tuple[str, bool], Summary] = MappingProxyType(
    {
        ("A", False): Summary(72, 504, 62, 493, 0.897, 0.799),
        ("A", True): Summary(72, 504, 65, 497, 0.905, 0.812),
        ("B", False): Summary(63, 378, 56, 371, 0.876, 0.732),
        ("B", True): Summary(63, 378, 56, 370, 0.909, 0.808),
    }
)
"""Table 4.18: by scene and whether the map is a grid."""

TOTAL = Summary(270, 1764, 239, 1731, 0.897, 0.788)
"""The last line of Table 4.18."""
