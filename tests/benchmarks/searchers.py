"""How good and how fast every searcher is: simulated sketches, and the same for its peers.

Run it with ``make bench-searchers``; it takes about twenty minutes. All rows of a size, or of a
kind of sketch, are measured in the same run, on the same scenes. A second table has the judged
answers of whole matches, where sketches show parts of maps, or what is not there, or another place.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from statistics import mean, median

import numpy as np
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from sketchmatch.api import MatchProblem, Outcome, Searcher
from sketchmatch.model import Fmap, IntArray, RelationTable
from sketchmatch.pipeline.correspond import fmap_confidence, object_map, occm
from sketchmatch.pipeline.describe import describe
from sketchmatch.pipeline.relate import relate
from sketchmatch.pipeline.selection import resolve
from sketchmatch.pipeline.slices import finish
from sketchmatch.registry import Kind, default_registry
from sketchmatch.testing import random_scene, simulate_sketch
from tests.benchmarks.aligners import ALIGNERS
from tests.benchmarks.answers import CASES, NOTES, Answer, Case, answers, answers_table
from tests.benchmarks.peers import PEERS, Peer
from tests.oracle.enumeration import best_of_all

_DRAWING = {"displacement": 0.3, "turn": 0.3, "stretch": 0.25, "wobble": 0.1}  # ζ* about 0.9
_EQUAL = 1e-9
_MOST_MAPS = math.factorial(8)
_SKETCHES = 10
_ANSWER_BUDGET = 2.0
_WIDTH = 108

TRUTH = "the truth"
ENUMERATION = "all maps (numba)"

_NOTES = f"""\
Sketches: random hexagons, drawn with {", ".join(f"{k} {v}" for k, v in _DRAWING.items())}. \
The relation table is given to every method; its time is not counted.
median ms: searchers, the search alone with kernels compiled and default parameters; peers, the \
solver alone without the making of its input. ">": half of the runs or more were stopped at the \
budget, with what they had by then.
own ζ: median ζ of the FMAP found. nn, nn-pso and fsnn-pso need no object-consistent FMAP, so \
theirs may be above every object map's and still lead to a bad one.
map ζ: median ζ of the FMAP that the resulting object map induces. best ζ: share of runs where \
that reaches the best of all rows of the table (within 1e-9). right: share of runs with all \
partners right; "the truth" shows how often the best ζ is that of the right map.
proved: share of runs that ended with a proof. stopped: share stopped at the budget. \
"{ENUMERATION}": ζ of every object map, where there are at most 8! of them."""

_PEER_NOTES = """\
Peers are given σ alone: they maximise a sum over pairs, which ζR and ζL are not, and σ is the \
same for a pair and its dual, so they see neither directions nor sizes. Their answers are scored \
by ζ as all others; none of them aims at it.
pygmtools (RRWM, IPFP, SM; numpy, defaults, rounded by its Hungarian method): the dense affinity \
K[(a,c),(b,d)] = σ of (a,b)→(c,d) less the least σ of (a,b), which takes the same from every map \
and helps them; no unary term. pylibmgm (solve_gm, defaults): the same, negated, as sparse costs. \
Both are left out (–) at 100 objects, where K takes 800 MB and the edges number 49 million.
scipy FAQ takes no four-index affinity but two matrices: it is given A, B with A[a,b]·B[c,d] the \
best rank-one approximation of σ, less the means that add the same to every map; A is padded with \
zeros where the map has more objects."""


@dataclass(frozen=True)
class Size:
    """One size of problem: how many objects, scenes, and seconds for each search."""

    drawn: int
    mapped: int
    scenes: int
    budget: float

    @property
    def candidates(self) -> int:
        """N·N', the number of pairings of objects."""
        return self.drawn * self.mapped

    def __str__(self) -> str:
        return f"{self.drawn}" if self.drawn == self.mapped else f"{self.drawn} in {self.mapped}"


SIZES = (
    *(Size(objects, objects, 40, 10.0) for objects in range(3, 9)),
    Size(10, 10, 30, 10.0),
    Size(12, 12, 20, 10.0),
    Size(16, 16, 6, 10.0),
    Size(20, 20, 5, 10.0),
    Size(8, 36, 15, 10.0),
    Size(50, 50, 2, 5.0),
    Size(100, 100, 1, 15.0),
)


@dataclass(frozen=True)
class Run:
    """What one method made of one scene.

    Attributes
    ----------
    seconds
        How long it took, or None where nothing was run.
    own
        ζ of its FMAP.
    confidence
        ζ of the FMAP that its object map induces.
    right
        Whether the object map is the truth.
    proved, stopped
        Whether it ended with a proof or at the budget; None where it can do neither.
    """

    seconds: float | None
    own: float
    confidence: float
    right: bool
    proved: bool | None = None
    stopped: bool | None = None


Results = dict[Size, list[dict[str, Run]]]
"""For each size and scene the run of each method."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure and print."""
    options = _options(arguments)
    for searcher in options.searchers:
        searcher.warm_up()
    peers = [peer for peer in options.peers if peer.installed]
    _run_scene(SIZES[0], 0, options.seed, [], peers)  # loads libraries and kernels
    results: Results = {}
    with Progress(console=Console(stderr=True)) as progress:
        task = progress.add_task("", total=sum(size.scenes for size in options.sizes))
        for size in options.sizes:
            results[size] = []
            started = time.perf_counter()
            for scene in range(size.scenes):
                progress.update(task, description=f"{size} objects")
                runs = _run_scene(size, scene, options.seed, options.searchers, peers)
                results[size].append(runs)
                progress.advance(task)
            seconds = time.perf_counter() - started
            progress.console.print(f"{size} objects, {size.scenes} scenes: {seconds:.0f} s")
    methods = [searcher.name for searcher in options.searchers]
    methods += [peer.name for peer in peers]
    console = Console()
    if not console.is_terminal:
        console = Console(width=_WIDTH)
    if results:
        console.print(_table(results, [*methods, ENUMERATION, TRUTH]))
        for line in [*_findings(results), _NOTES, *([_PEER_NOTES] if options.peers else [])]:
            console.print(line, highlight=False, markup=False)
    if options.cases:
        console.print(answers_table(_answers(options)))
        console.print(NOTES, highlight=False, markup=False)
    for package in sorted({peer.package for peer in options.peers if not peer.installed}):
        console.print(f"{package} is not installed, so it is left out (make .venv/bench)")


def _answers(options: argparse.Namespace) -> dict[Case, list[dict[str, Answer]]]:
    """Let every searcher, and the methods that align, answer sketches of each kind."""
    aligners = [aligner for aligner in options.aligners if aligner.installed]
    names = [searcher.name for searcher in options.searchers]
    answers(options.cases[0], 0, names, aligners, options.answer_budget)  # loads what they need
    with Progress(console=Console(stderr=True)) as progress:
        task = progress.add_task("", total=len(options.cases) * options.sketches)
        results: dict[Case, list[dict[str, Answer]]] = {}
        for case in options.cases:
            progress.update(task, description=case.name)
            results[case] = []
            for number in range(options.sketches):
                found = answers(case, number, names, aligners, options.answer_budget)
                results[case].append(found)
                progress.advance(task)
    return results


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    known = {item.name: item.algorithm for item in default_registry().of_kind(Kind.SEARCHER)}
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--sizes", help="such as 3,8,8x36 (8 objects drawn of 36)")
    parser.add_argument("--scenes", type=int, help="number of scenes of each size")
    parser.add_argument("--budget", type=float, help="seconds for each search")
    parser.add_argument("--searchers", help=f"some of {','.join(known)}")
    parser.add_argument("--no-peers", dest="peers", action="store_const", const=(), default=PEERS)
    parser.add_argument("--sketches", type=int, default=_SKETCHES, help="of each kind to answer")
    parser.add_argument(
        "--answers",
        choices=("too", "only", "none"),
        default="too",
        help="the table of whole matches",
    )
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args(arguments)
    names = options.searchers.split(",") if options.searchers else list(known)
    if unknown := [name for name in names if name not in known]:
        parser.error(f"no searcher is called {', '.join(unknown)}; there are {', '.join(known)}")
    options.searchers = [known[name] for name in names]
    try:
        sizes = [_size(text) for text in options.sizes.split(",")] if options.sizes else SIZES
    except ValueError as error:
        parser.error(f"--sizes: {error}")
    chosen = {"scenes": options.scenes, "budget": options.budget}
    given = {key: value for key, value in chosen.items() if value is not None}
    if any(value <= 0 for value in given.values()):
        parser.error("--scenes and --budget must be positive")
    if options.sketches <= 0:
        parser.error("--sketches must be positive")
    options.sizes = [replace(size, **given) for size in sizes if options.answers != "only"]
    options.cases = () if options.answers == "none" else CASES
    options.answer_budget = options.budget or _ANSWER_BUDGET
    options.aligners = ALIGNERS if options.peers else ()
    return options


def _size(text: str) -> Size:
    """Return the size that a text means, with the scenes and budget of the next known one."""
    drawn, _, mapped = text.partition("x")
    objects = (int(drawn), int(mapped or drawn))
    if not 3 <= objects[0] <= objects[1]:
        raise ValueError(f"{text} is not 3 or more objects drawn of as many or more")
    known = sorted(SIZES, key=lambda size: size.candidates)
    fitting = (size for size in known if size.candidates >= math.prod(objects))
    return replace(next(fitting, known[-1]), drawn=objects[0], mapped=objects[1])


def _run_scene(
    size: Size, scene: int, seed: int, searchers: Sequence[type[Searcher]], peers: Sequence[Peer]
) -> dict[str, Run]:
    """Draw one sketch and let every method match it."""
    table, truth = _problem(size, (seed, size.drawn, size.mapped, scene))
    runs = {searcher.name: _search(searcher, table, truth, size, scene) for searcher in searchers}
    for peer in peers:
        if size.candidates <= peer.limit:
            runs[peer.name] = _timed(peer.prepare(table), table, truth)
    if math.perm(size.mapped, size.drawn) <= _MOST_MAPS:
        runs[ENUMERATION] = _timed(lambda: best_of_all(table)[1], table, truth)
    runs[TRUTH] = replace(_timed(lambda: truth, table, truth), seconds=None)
    return runs


def _problem(size: Size, seed: Sequence[int]) -> tuple[RelationTable, IntArray]:
    """Return the relations of a sketch and its map, and which object stands for which."""
    rng = np.random.default_rng(seed)
    scene = random_scene(rng, size.mapped)
    chosen = rng.permutation(size.mapped)[: size.drawn].tolist()
    sketch = simulate_sketch(scene, rng, objects=chosen, **_DRAWING)
    pipeline = resolve(default_registry(), {})
    template = finish(describe(sketch.scene, pipeline.histogram))
    argument = finish(describe(scene, pipeline.histogram))
    return finish(relate(template, argument, pipeline.similarity)), sketch.partners


def _search(
    searcher: type[Searcher], table: RelationTable, truth: IntArray, size: Size, scene: int
) -> Run:
    """Run a searcher as a host does: to its end, or closing it at the budget."""
    # Each has a table of its own, so that none finds cosines that another has computed.
    problem = MatchProblem(replace(table), time_budget=size.budget)
    rng = np.random.default_rng(scene)
    outcome = Outcome.TIME_BUDGET
    started = time.perf_counter()
    work = searcher().search(problem, rng)
    last = next(work)
    while time.perf_counter() - started < size.budget:
        try:
            last = next(work)
        except StopIteration as stop:
            outcome = stop.value
            break
    work.close()
    seconds = time.perf_counter() - started
    partners = object_map(occm(last.fmap, table)).partners
    return Run(
        seconds,
        fmap_confidence(last.fmap, table).total,
        _confidence(partners, table),
        bool((partners == truth).all()),
        None if last.upper_bound is None else outcome is Outcome.OPTIMAL,
        outcome is Outcome.TIME_BUDGET,
    )


def _timed(solve: Callable[[], IntArray], table: RelationTable, truth: IntArray) -> Run:
    started = time.perf_counter()
    answer = solve()
    seconds = time.perf_counter() - started
    partners = _completed(answer, table.argument_objects)
    confidence = _confidence(partners, table)
    return Run(seconds, confidence, confidence, bool((partners == truth).all()))


def _completed(partners: IntArray, others: int) -> IntArray:
    """Give objects without a partner, −1, the first ones that are free."""
    free = np.setdiff1d(np.arange(others), partners)
    completed = np.array(partners, dtype=np.int64)
    completed[completed < 0] = free[: (completed < 0).sum()]
    return completed


def _confidence(partners: IntArray, table: RelationTable) -> float:
    return fmap_confidence(Fmap.from_object_map(partners, table.argument_objects), table).total


def _table(results: Results, methods: Sequence[str]) -> Table:
    table = Table(title="searchers on simulated sketches", title_justify="left")
    table.add_column("objects", no_wrap=True)
    table.add_column("scenes", justify="right")
    table.add_column("method", no_wrap=True)
    for column in ("median ms", "own ζ", "map ζ", "best ζ", "right", "proved", "stopped"):
        table.add_column(column, justify="right")
    for size, scenes in results.items():
        best = _best(scenes)
        head = (str(size), str(len(scenes)))
        for method in methods:
            if method == ENUMERATION and method not in scenes[0]:
                continue
            runs = [scene[method] for scene in scenes if method in scene]
            table.add_row(*head, method, *_figures(runs, best))
            head = ("", "")
        table.add_section()
    return table


def _figures(runs: Sequence[Run], best: Sequence[float]) -> list[str]:
    """Return a row of the table for a method's runs; dashes for what there is not."""
    if not runs:
        return ["–"] * 7
    return [
        _milliseconds(runs),
        f"{median(run.own for run in runs):.4f}",
        f"{median(run.confidence for run in runs):.4f}",
        _share([run.confidence >= top - _EQUAL for run, top in zip(runs, best, strict=True)]),
        _share([run.right for run in runs]),
        _share([run.proved for run in runs]),
        _share([run.stopped for run in runs]),
    ]


def _milliseconds(runs: Sequence[Run]) -> str:
    seconds = [run.seconds for run in runs if run.seconds is not None]
    if not seconds:
        return "–"
    value = 1e3 * median(seconds)
    over = ">" if mean(bool(run.stopped) for run in runs) >= 0.5 else ""
    return f"{over}{value:,.{0 if value >= 100 else 1 if value >= 10 else 2}f}"


def _share(values: Sequence[bool | None]) -> str:
    known = [value for value in values if value is not None]
    return f"{mean(known):.1%}" if known else "–"


def _best(scenes: Sequence[dict[str, Run]]) -> list[float]:
    """Return the best ζ of an object map that any method found in each scene."""
    return [max(run.confidence for run in runs.values()) for runs in scenes]


def _findings(results: Results) -> list[str]:
    """Return what follows from comparing rows: exact against enumeration, and whose proof fails."""
    lines = []
    for size, scenes in results.items():
        pairs = [(runs["exact"], runs[ENUMERATION]) for runs in scenes if _both(runs)]
        if pairs and math.perm(size.mapped, size.drawn) == _MOST_MAPS:
            ratios = [every.seconds / exact.seconds for exact, every in pairs]
            lines.append(
                f"exact at {size} objects against enumeration of all {_MOST_MAPS} maps: "
                f"{median(ratios):.1f} times as fast in the median, {min(ratios):.1f} to "
                f"{max(ratios):.1f} (to reach: 20)"
            )
    wrong = [
        f"{method} at {size} objects, scene {scene}"
        for size, scenes in results.items()
        for scene, (runs, best) in enumerate(zip(scenes, _best(scenes), strict=True))
        for method, run in runs.items()
        if run.proved and run.confidence < best - 2 * _EQUAL
    ]
    return [*lines, f"proofs that another row refutes: {', '.join(wrong) or 'none'}"]


def _both(runs: dict[str, Run]) -> bool:
    return "exact" in runs and ENUMERATION in runs


if __name__ == "__main__":
    main()
