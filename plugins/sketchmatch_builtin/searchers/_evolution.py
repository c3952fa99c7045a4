"""Compiled steps of the evolutionary search, for both meanings of a legal FMAP.

An individual is either an object map (all legal FMAPs under object consistency are induced by
one) or the entries of an FMAP (pairwise).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sketchmatch.api.kernels import fmap_confidence_above, kernel
from sketchmatch.model import FloatArray, IntArray

__all__ = ["Evolution", "evolve", "populate"]

GENERATION, STALE, EVALUATIONS, MEMBERS, TRIAL, BRED, JUDGED = range(7)


class Evolution(NamedTuple):
    """A population with its offspring, changed in place by the steps of the evolution.

    p is the size of the population. N and N' are the objects, Q and Q'/2 the pairs of the
    template and the argument; all integers are int64.

    Attributes
    ----------
    by_object
        Whether individuals are object maps, shape (N,), and not FMAPs, shape (Q,).
    rates
        Shape (3,): Pc, Px and Pm.
    pairs, columns
        Shapes (Q, 2) and (N', N'): the template pairs, and the histogram correspondence of each
        ordered argument pair.
    evidence, cosine, sine, dilation, weights
        As :func:`~sketchmatch.api.kernels.fmap_confidence` takes them.
    individuals
        Shape (3p, N) or (3p, Q): the population, its offspring and room for more, in any order.
    places
        Shape (3p,): where they are; first the population, the fittest first, then the offspring
        of a generation that may survive it, then the room.
    fitness
        Shape (3p,): ζ of the individual in each place; −1 where the population has no member.
    known
        Shape (a power of 2,): hash codes of individuals that were judged. Each is a member, or was
        less fit than all members when it was judged or left, so that it would not survive now.
    status
        Shape (7,): the generation, the generations since a better best was found, the FMAPs
        evaluated, the members of the population, and within a generation the trials done, the
        offspring that may survive and how many of them have competed.
    order, entries
        Shape (Q,): room for an order in which to visit entries, and for the entries of an FMAP.
    holders, free
        Shapes (2, N') or (2, Q'/2), and half of it: room for who has each object or pair of the
        argument, and for those that nobody has.
    scratch
        Shape (Q,).
    seed
        uint64, shape (1,): the state of the random numbers, not 0.
    """

    by_object: bool
    rates: FloatArray
    pairs: IntArray
    columns: IntArray
    evidence: FloatArray
    cosine: FloatArray
    sine: FloatArray
    dilation: FloatArray
    weights: FloatArray
    individuals: IntArray
    places: IntArray
    fitness: FloatArray
    known: IntArray
    status: IntArray
    order: IntArray
    entries: IntArray
    holders: IntArray
    free: IntArray
    scratch: FloatArray
    seed: NDArray[np.uint64]


@kernel
def populate(evolution: Evolution, allowance: int) -> bool:
    """Fill the population with random individuals.

    Parameters
    ----------
    evolution
        A population that has its first member.
    allowance
        The work to do in this call, about in entries of FMAPs that are drawn or evaluated.

    Returns
    -------
    bool
        Whether it is done.
    """
    status, size = evolution.status, _size(evolution)
    while allowance > 0 and status[TRIAL] < size:
        child = evolution.individuals[evolution.places[size]]
        _draw_individual(child, evolution.free, not evolution.by_object, evolution.seed)
        if not _is_known(evolution.known, child):
            _judge(evolution, 0)
        if status[BRED] == 1:
            _compete(evolution, 0)
            status[BRED] = 0
        status[TRIAL] += 1
        allowance -= evolution.order.size
    if status[TRIAL] < size:
        return False
    _begin_generation(status)
    return True


@kernel
def evolve(evolution: Evolution, generations: int, patience: int, allowance: int) -> bool:
    """Cross, mutate and select until a limit is reached.

    Each generation consists of p // 2 trials to cross two parents and p trials to mutate one;
    then the offspring compete with their parents.

    Parameters
    ----------
    evolution
        A population that has been founded.
    generations, patience
        Limits on all generations, and on those without a better best.
    allowance
        As for :func:`populate`; a generation may be left and resumed at any point.

    Returns
    -------
    bool
        Whether a limit is reached.
    """
    status, size = evolution.status, _size(evolution)
    while status[GENERATION] < generations and status[STALE] < patience:
        if allowance <= 0:
            return False
        if status[TRIAL] < size // 2:
            allowance -= _cross(evolution, size // 2, allowance)
        elif status[TRIAL] < size // 2 + size:
            allowance -= _mutate(evolution, size // 2 + size, allowance)
        elif status[JUDGED] < status[BRED]:
            allowance -= _compete(evolution, status[JUDGED])
            status[JUDGED] += 1
        else:
            status[GENERATION] += 1
            _begin_generation(status)
    return True


@kernel
def _size(evolution: Evolution) -> int:
    return evolution.places.size // 3


@kernel
def _begin_generation(status: IntArray) -> None:
    status[STALE] += 1
    status[TRIAL] = status[BRED] = status[JUDGED] = 0


@kernel
def _judge(evolution: Evolution, k: int) -> None:
    """Judge the k-th offspring; if it may survive, it takes the place after those that may."""
    size, status, places = _size(evolution), evolution.status, evolution.places
    child = evolution.individuals[places[size + k]]
    entries = child
    if evolution.by_object:
        entries = evolution.entries
        for i in range(entries.size):
            a, b = evolution.pairs[i, 0], evolution.pairs[i, 1]
            entries[i] = evolution.columns[child[a], child[b]]
    floor = evolution.fitness[size - 1]
    value = fmap_confidence_above(
        floor,
        entries,
        evolution.scratch,
        evolution.evidence,
        evolution.cosine,
        evolution.sine,
        evolution.dilation,
        evolution.weights,
    )[0]
    status[EVALUATIONS] += 1
    if value > floor:
        place = size + status[BRED]
        places[place], places[size + k] = places[size + k], places[place]
        evolution.fitness[place] = value
        status[BRED] += 1


@kernel
def _compete(evolution: Evolution, k: int) -> int:
    """Let the k-th offspring replace the last member, unless it is worse than all or known.

    Returns
    -------
    int
        The work that it took, about in steps of the ranking.
    """
    individuals, places, fitness = evolution.individuals, evolution.places, evolution.fitness
    size, status = _size(evolution), evolution.status
    here, value = places[size + k], fitness[size + k]
    if value <= fitness[size - 1]:
        return 0
    rank: int = status[MEMBERS]
    while rank > 0 and fitness[rank - 1] < value:
        rank -= 1
    same = rank - 1
    while same >= 0 and fitness[same] == value:
        if np.all(individuals[places[same]] == individuals[here]):
            return rank - same
        same -= 1
    last: int = min(status[MEMBERS], size - 1)
    places[size + k] = places[last]
    for place in range(last, rank, -1):
        places[place], fitness[place] = places[place - 1], fitness[place - 1]
    places[rank], fitness[rank] = here, value
    status[MEMBERS] = last + 1
    if rank == 0:
        status[STALE] = -1
    return last - same


@kernel
def _is_known(known: IntArray, individual: IntArray) -> bool:
    """Return whether an individual was judged before, as far as is remembered; it is known now.

    Two individuals have the same hash code (FNV-1a by Fowler, Noll and Vo, a gene at a time) with
    a probability of 2⁻⁶⁴.
    """
    code = -3750763034362895579
    for k in range(individual.size):
        code = (code ^ individual[k]) * 1099511628211
    slot = (code >> 24) & (known.size - 1)
    if known[slot] == code:
        return True
    known[slot] = code
    return False


@kernel
def _random(seed: NDArray[np.uint64]) -> float:
    """Return a random number in [0, 1): xorshift64* (Vigna 2016), fast enough for a gene."""
    state = seed[0]
    state ^= state >> np.uint64(12)
    state ^= state << np.uint64(25)
    state ^= state >> np.uint64(27)
    seed[0] = state
    return float((state * np.uint64(2685821657736338717)) >> np.uint64(11)) * 2.0**-53


@kernel
def _draw(items: IntArray, place: int, seed: NDArray[np.uint64]) -> None:
    """Swap a random one of items[place:] to ``place``."""
    other = place + int(_random(seed) * (items.size - place))
    items[place], items[other] = items[other], items[place]


@kernel
def _draw_individual(
    individual: IntArray, free: IntArray, with_duals: bool, seed: NDArray[np.uint64]
) -> None:
    """Draw a legal individual at random."""
    for k in range(free.size):
        free[k] = k
    for k in range(individual.size):
        _draw(free, k, seed)
        individual[k] = free[k]
        if with_duals:
            individual[k] += free.size * (_random(seed) < 0.5)


@kernel
def _cross(evolution: Evolution, trials: int, allowance: int) -> int:
    """Cross random parents and judge the children, until so many trials are done in all.

    Returns
    -------
    int
        The work that it took; not much more than allowed.
    """
    individuals, places, status = evolution.individuals, evolution.places, evolution.status
    seed, known = evolution.seed, evolution.known
    size, members, work = _size(evolution), status[MEMBERS], 0
    while status[TRIAL] < trials and work < allowance:
        status[TRIAL] += 1
        work += 1
        if members < 2 or _random(seed) >= evolution.rates[0]:
            continue
        first = int(_random(seed) * members)
        second = int(_random(seed) * (members - 1))
        second += second >= first
        one, other = individuals[places[first]], individuals[places[second]]
        bred = status[BRED]
        child, sibling = individuals[places[size + bred]], individuals[places[size + bred + 1]]
        if evolution.by_object:
            _cross_object_maps(
                one,
                other,
                child,
                sibling,
                evolution.pairs,
                evolution.rates[1],
                evolution.order,
                evolution.holders,
                evolution.free,
                seed,
            )
        else:
            _exchange(one, other, child, sibling, evolution.rates[1], seed)
            for each in (child, sibling):
                _legalize(each, evolution.order, evolution.holders[0], evolution.free, seed)
        work += 2 * evolution.order.size
        for k in (bred, bred + 1):
            if not _is_known(known, individuals[places[size + k]]):
                _judge(evolution, k)
    return work


@kernel
def _mutate(evolution: Evolution, trials: int, allowance: int) -> int:
    """Change entries of random parents, one or more, and judge the children, as :func:`_cross`."""
    individuals, places, status = evolution.individuals, evolution.places, evolution.status
    seed, known = evolution.seed, evolution.known
    size, work = _size(evolution), 0
    while status[TRIAL] < trials and work < allowance:
        status[TRIAL] += 1
        work += 1
        if _random(seed) >= evolution.rates[2]:
            continue
        parent = individuals[places[int(_random(seed) * status[MEMBERS])]]
        child = individuals[places[size + status[BRED]]]
        for k in range(child.size):
            child[k] = parent[k]
        changing = True
        while changing:
            if evolution.by_object:
                _reassign(child, evolution.pairs, evolution.holders[0], evolution.free, seed)
            else:
                _replace(child, evolution.free.size, seed)
            changing = _random(seed) < 0.5
        work += evolution.order.size
        if not _is_known(known, child):
            _judge(evolution, status[BRED])
    return work


@kernel
def _cross_object_maps(
    one: IntArray,
    other: IntArray,
    child: IntArray,
    sibling: IntArray,
    pairs: IntArray,
    exchange_rate: float,
    order: IntArray,
    holders: IntArray,
    free: IntArray,
    seed: NDArray[np.uint64],
) -> None:
    """Cross two FMAPs, entry by entry, into two object-consistent children.

    The entries of the crossed FMAPs are visited in random order. An entry (a, b) → (c, d) stays if
    it agrees with those that stayed before; all others change to what these imply. Template
    objects that no entry decides get random partners.
    """
    holder, sibling_holder = holders[0], holders[1]
    child[:] = -1
    sibling[:] = -1
    holder[:] = -1
    sibling_holder[:] = -1
    missing = 2 * child.size
    for k in range(order.size):
        if missing == 0:
            return
        _draw(order, k, seed)
        a, b = pairs[order[k], 0], pairs[order[k], 1]
        c, d, e, f = one[a], one[b], other[a], other[b]
        if _random(seed) < exchange_rate:
            c, d, e, f = e, f, c, d
        missing -= _keep(child, holder, a, b, c, d)
        missing -= _keep(sibling, sibling_holder, a, b, e, f)
    _complete(child, holder, free, seed)
    _complete(sibling, sibling_holder, free, seed)


@kernel
def _keep(child: IntArray, holder: IntArray, a: int, b: int, c: int, d: int) -> int:
    """Put (a, b) → (c, d) into a map if it agrees with it; return how many objects it decides."""
    old_c, old_d = child[a], child[b]
    # −1 stands for nobody. Without short circuits there is one branch, and it is seldom taken.
    fits_a = (old_c == c) | ((old_c & holder[c]) < 0)
    fits_b = (old_d == d) | ((old_d & holder[d]) < 0)
    decided = int(old_c < 0) + int(old_d < 0)
    if fits_a & fits_b & (decided > 0):
        child[a], child[b] = c, d
        holder[c], holder[d] = a, b
        return decided
    return 0


@kernel
def _complete(child: IntArray, holder: IntArray, free: IntArray, seed: NDArray[np.uint64]) -> None:
    """Give random unused partners to the objects that have none."""
    count = 0
    for c in range(holder.size):
        if holder[c] < 0:
            free[count] = c
            count += 1
    place = 0
    for a in range(child.size):
        if child[a] < 0:
            _draw(free[:count], place, seed)
            child[a] = free[place]
            place += 1


@kernel
def _reassign(
    child: IntArray,
    pairs: IntArray,
    holder: IntArray,
    free: IntArray,
    seed: NDArray[np.uint64],
) -> None:
    """Change one entry of the FMAP at random and make all others agree with it.

    In half of the cases the new correspondence shares an object with the old one.
    """
    i = int(_random(seed) * pairs.shape[0])
    a, b = pairs[i, 0], pairs[i, 1]
    holder[:] = -1
    for k in range(child.size):
        holder[child[k]] = k
    c = int(_random(seed) * holder.size)
    d = child[b]
    if c == d or _random(seed) < 0.5:
        d = int(_random(seed) * (holder.size - 1))
        d += d >= c
    for k in (a, b):
        holder[child[k]] = -1
    for k in (holder[c], holder[d]):
        if k >= 0:
            child[k] = -1
    child[a], child[b] = c, d
    holder[c], holder[d] = a, b
    _complete(child, holder, free, seed)


@kernel
def _exchange(
    one: IntArray,
    other: IntArray,
    child: IntArray,
    sibling: IntArray,
    exchange_rate: float,
    seed: NDArray[np.uint64],
) -> None:
    """Cross two FMAPs, entry by entry, into two that may hold conflicts."""
    for i in range(child.size):
        if _random(seed) < exchange_rate:
            child[i], sibling[i] = other[i], one[i]
        else:
            child[i], sibling[i] = one[i], other[i]


@kernel
def _legalize(
    child: IntArray,
    order: IntArray,
    holder: IntArray,
    free: IntArray,
    seed: NDArray[np.uint64],
) -> None:
    """Change conflicting entries at random until no argument pair is used twice."""
    pairs = holder.size
    holder[:] = -1
    conflicts = 0
    for k in range(order.size):
        _draw(order, k, seed)
        column = child[order[k]] % pairs
        if holder[column] < 0:
            holder[column] = order[k]
        else:
            order[conflicts], order[k] = order[k], order[conflicts]
            conflicts += 1
    if conflicts == 0:
        return
    count = 0
    for column in range(pairs):
        if holder[column] < 0:
            free[count] = column
            count += 1
    for k in range(conflicts):
        _draw(free[:count], k, seed)
        child[order[k]] = free[k] + pairs * (_random(seed) < 0.5)


@kernel
def _replace(child: IntArray, argument_pairs: int, seed: NDArray[np.uint64]) -> None:
    """Change one entry at random, and the entry that it conflicts with to what it frees."""
    place = int(_random(seed) * child.size)
    value = int(_random(seed) * 2 * argument_pairs)
    for i in range(child.size):
        if i != place and child[i] % argument_pairs == value % argument_pairs:
            child[i] = child[place] % argument_pairs + argument_pairs * (_random(seed) < 0.5)
    child[place] = value
