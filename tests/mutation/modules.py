"""What is mutated, and which tests speak of it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from tests.tools import ROOT

_EXACT = "plugins/test_exact_bounds plugins/test_exact"
_FORCES = "unit/test_constant_force unit/test_force_histogram"
_MATCHED = "unit/test_match unit/test_public"
_PLANS = "plugins/test_segmenter_rooms_of_drawings"
_STROKES = (
    "plugins/test_segmenter_strokes plugins/test_segmenter_strokes_rules "
    "plugins/test_segmenter_strokes_joints plugins/test_segmenter_strokes_sloppy"
)
_SVG = "unit/test_io_svg unit/test_io_svg_shown unit/test_io_svg_tools"

_GROUPS = {
    "kernels": (
        "engine/sketchmatch/kernels/*.py",
        {
            "_jit": "unit/test_jit",
            "alignment": "unit/test_alignment unit/test_relate",
            "confidence": "unit/test_confidence",
            "constant_force": "unit/test_constant_force",
            "evidence": "unit/test_evidence",
            "exchange": "unit/test_alternatives",
            "hybrid_force": "unit/test_hybrid_force plugins/test_histograms",
            "incremental": "unit/test_incremental",
            "pairs": "unit/test_relations unit/test_incremental",
            "power_force": "unit/test_force_histogram",
            "projection": _FORCES,
            "raster": "unit/test_raster unit/test_force_histogram",
            "similarity": "plugins/test_similarities",
            "sweep": _FORCES,
        },
    ),
    "pipeline": (
        "engine/sketchmatch/pipeline/*.py",
        {
            "ambiguity": "unit/test_ambiguity",
            "answer": f"unit/test_ambiguity unit/test_judge {_MATCHED}",
            "clock": _MATCHED,
            "compare": "unit/test_compare unit/test_relate unit/test_evidence",
            "correspond": "unit/test_correspond unit/test_confidence unit/test_judge",
            "engine": "unit/test_compare unit/test_public",
            "events": _MATCHED,
            "guard": f"unit/test_registry {_MATCHED}",
            "judge": "unit/test_judge unit/test_thesis_profile",
            "knowledge": "unit/test_knowledge unit/test_obeying",
            "match": f"{_MATCHED} unit/test_unmatched unit/test_evidence",
            "obeying": "unit/test_obeying",
            "reading": _MATCHED,
            "request": f"unit/test_selection unit/test_judge {_MATCHED}",
            "result": _MATCHED,
            "said": "unit/test_ambiguity",
            "search": f"unit/test_unmatched unit/test_judge {_MATCHED}",
            "segment": _MATCHED,
            "warmup": "unit/test_startup unit/test_match",
        },
    ),
    "searchers": (
        "plugins/sketchmatch_builtin/searchers/*.py",
        {
            "_assignment": _EXACT,
            "_backtrack": _EXACT,
            "_branch": _EXACT,
            "_cells": _EXACT,
            "_evolution": "plugins/test_easm_steps plugins/test_easm",
            "_fixed": _EXACT,
            "_growers": "plugins/test_fsnn_pso",
            "_memetic": "plugins/test_direct_steps plugins/test_direct",
            "_moves": "plugins/test_direct_steps plugins/test_direct",
            "_neighbours": "plugins/test_nn plugins/test_nn_pso plugins/test_fsnn_pso",
            "_ranking": f"plugins/test_direct {_EXACT}",
            "_relations": _EXACT,
            "_residual": _EXACT,
            "_swarm": "plugins/test_nn_pso plugins/test_fsnn_pso",
            "align": "plugins/test_align unit/test_reference",
            "auto": "plugins/test_auto unit/test_reference",
            "direct": "plugins/test_direct unit/test_reference",
            "easm": "plugins/test_easm unit/test_reference",
            "exact": f"{_EXACT} unit/test_reference",
            "fsnn_pso": "plugins/test_fsnn_pso unit/test_reference",
            "nn": "plugins/test_nn unit/test_reference",
            "nn_pso": "plugins/test_nn_pso unit/test_reference",
        },
    ),
    "judges": (
        "plugins/sketchmatch_builtin/judges/*.py",
        {
            "_odds": "unit/test_probability unit/test_judge",
            "calibration": "unit/test_probability unit/test_learning plugins/test_posterior",
            "confidence": "unit/test_judge unit/test_thesis_profile",
            "_described": "plugins/test_posterior",
            "_evidence": "plugins/test_posterior",
            "posterior": "plugins/test_posterior",
        },
    ),
    "alignment": (
        "plugins/sketchmatch_builtin/alignment/*.py",
        {
            "_candidates": "plugins/test_alignment_candidates plugins/test_align",
            "_forms": "unit/test_forms",
            "_measures": "plugins/test_alignment_measures",
            "_poses": "plugins/test_alignment_poses plugins/test_alignment_candidates",
            "_selves": "plugins/test_alignment_things",
            "_sides": "plugins/test_alignment_things",
            "_things": "plugins/test_alignment_things",
        },
    ),
    "transfers": (
        "engine/sketchmatch/transfers/*.py",
        {
            "carrying": "unit/test_carried",
            "features": "unit/test_carried unit/test_mending",
            "files": "unit/test_feature_files",
            "obstacles": "unit/test_obstacles unit/test_planning unit/test_feature_files",
        },
    ),
    "svg": (
        "engine/sketchmatch/io/*svg*.py",
        {
            "_svg_curves": _SVG,
            "_svg_frame": _SVG,
            "_svg_ink": "unit/test_io_svg_ink",
            "_svg_names": _SVG,
            "_svg_shapes": _SVG,
            "_svg_style": _SVG,
            "_svg_tree": _SVG,
            "svg": _SVG,
        },
    ),
    "drawings": (
        "plugins/sketchmatch_builtin/segmenters/_[lpsw]*.py",
        {
            "_landmarks": _PLANS,
            "_leaves": "plugins/test_segmenter_rooms",
            "_lines": _PLANS,
            "_plan_things": f"plugins/test_plan_things {_PLANS}",
            "_plans": _PLANS,
            "_spaces": _PLANS,
            "_standing": "plugins/test_segmenter_lidar",
            "_strokes_chains": _STROKES,
            "_strokes_drawing": _STROKES,
            "_strokes_marks": _STROKES,
            "_strokes_outline": _STROKES,
            "_strokes_trace": _STROKES,
            "_swings": _PLANS,
            "_widths": _PLANS,
            "_writing": "plugins/test_writing",
        },
    ),
}

_COMPILED = {"_jit"}
_ROUNDS = {"kernels": (True,), "searchers": (True, False), "alignment": (True, False)}
"""Of groups whose tests run interpreted, at first or always; others run compiled."""


@dataclass(frozen=True)
class Module:
    """A module that is mutated.

    Attributes
    ----------
    group
        What it counts for.
    path
        Its file, from the root of the repository.
    tests
        Files whose tests run until one fails; first its own examples, if it has any.
    interpreted
        Of each round of tests whether kernels run as plain Python, so that none is compiled anew
        for each mutant. Most of what searches is found so, on few objects; what is left is tried
        on whole searches, which are compiled, a minute or two a mutant.
    """

    group: str
    path: str
    tests: tuple[str, ...]
    interpreted: tuple[bool, ...]

    @cached_property
    def source(self) -> str:
        """Its text, as it was at first."""
        return (ROOT / self.path).read_text(encoding="utf-8")


def modules() -> list[Module]:
    """Return all modules that are mutated, group by group."""
    found = []
    for group, (pattern, named) in _GROUPS.items():
        for file in sorted(ROOT.glob(pattern)):
            names = named.get(file.stem, f"unit/test_{file.stem}").split()
            tests = [f"tests/{name}.py" for name in names]
            path, text = file.relative_to(ROOT).as_posix(), file.read_text(encoding="utf-8")
            if ">>>" in text:
                tests.insert(0, path)
            interpreted = (False,) if file.stem in _COMPILED else _ROUNDS.get(group, (False,))
            if file.stem != "__init__":
                found.append(Module(group, path, tuple(tests), interpreted))
    return found


EQUIVALENT = Path(__file__).with_name("equivalent.toml")
"""Mutants that change no result, with the reason for each."""
