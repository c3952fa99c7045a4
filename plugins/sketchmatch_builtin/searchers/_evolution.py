"""Compiled generations of the evolutionary search, for both meanings of a legal FMAP.

A population is kept sorted, the fittest first. An individual is either an object map (all legal
FMAPs under object consistency are induced by one) or the entries of an FMAP (pairwise).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sketchmatch.api.kernels import fmap_confidence_above, kernel
from sketchmatch.model import FloatArray, IntArray

__all__ = [
    "breed_object_maps",
    "breed_pair_maps",
    "found_object_maps",
    "found_pair_maps",
    "judge_object_maps",
    "judge_pair_maps",
]

Relations = tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]
"""σ, cos R, sin R and L̂ of the relation table, and the weights of ζ."""


@kernel
def found_object_maps(
    population: IntArray,
    fitness: FloatArray,
    offspring: IntArray,
    argument_objects: int,
    rng: np.random.Generator,
) -> int:
    """Draw random injective object maps, shape (p, N), to be judged; return their number.

    ``offspring`` is room for (2p, N) individuals. Until they are judged the population holds the
    same maps, with a fitness below any other.
    """
    size, template_objects = population.shape
    free = np.arange(argument_objects)
    for k in range(size):
        for a in range(template_objects):
            _draw(free, a, rng)
            offspring[k, a] = free[a]
    population[:] = offspring[:size]
    fitness[:] = -1.0
    return len(population)


@kernel
def breed_object_maps(
    population: IntArray,
    offspring: IntArray,
    pairs: IntArray,
    argument_objects: int,
    rates: tuple[float, float, float],
    rng: np.random.Generator,
) -> int:
    """Write the offspring of one generation and return their number.

    ``pairs`` are the template pairs (Q, 2), ``rates`` are Pc, Px and Pm.
    """
    crossover_rate, exchange_rate, mutation_rate = rates
    size = population.shape[0]
    order = np.arange(pairs.shape[0])
    mask = np.empty(pairs.shape[0], dtype=np.bool_)
    holder = np.empty(argument_objects, dtype=np.int64)
    free = np.empty(argument_objects, dtype=np.int64)
    bred = 0
    for _ in range(size // 2):
        first, second = _two(size, rng)
        if rng.random() < crossover_rate:
            one, other = population[first], population[second]
            for i in range(mask.size):
                mask[i] = rng.random() < exchange_rate
            _mix(one, other, mask, offspring[bred], pairs, order, holder, free, rng)
            _mix(other, one, mask, offspring[bred + 1], pairs, order, holder, free, rng)
            bred += 2
    for _ in range(size):
        parent = int(rng.random() * size)
        if rng.random() < mutation_rate:
            offspring[bred] = population[parent]
            changing = True
            while changing:
                _reassign(offspring[bred], pairs, holder, free, rng)
                changing = rng.random() < 0.5
            bred += 1
    return bred


@kernel
def found_pair_maps(
    population: IntArray,
    fitness: FloatArray,
    offspring: IntArray,
    argument_pairs: int,
    rng: np.random.Generator,
) -> int:
    """Draw random FMAPs, shape (p, Q), as :func:`found_object_maps` draws object maps.

    They are one-to-one and hold no dual of an entry, whether or not they lead to an object map.
    """
    size, template_pairs = population.shape
    free = np.arange(argument_pairs)
    for k in range(size):
        for i in range(template_pairs):
            _draw(free, i, rng)
            offspring[k, i] = free[i] + argument_pairs * (rng.random() < 0.5)
    population[:] = offspring[:size]
    fitness[:] = -1.0
    return len(population)


@kernel
def breed_pair_maps(
    population: IntArray,
    offspring: IntArray,
    argument_pairs: int,
    rates: tuple[float, float, float],
    rng: np.random.Generator,
) -> int:
    """Write the offspring of one generation and return their number."""
    crossover_rate, exchange_rate, mutation_rate = rates
    size, template_pairs = population.shape
    holder = np.empty(argument_pairs, dtype=np.int64)
    free = np.empty(argument_pairs, dtype=np.int64)
    order = np.arange(template_pairs)
    bred = 0
    for _ in range(size // 2):
        first, second = _two(size, rng)
        if rng.random() < crossover_rate:
            one, other = offspring[bred], offspring[bred + 1]
            one[:] = population[first]
            other[:] = population[second]
            for i in range(template_pairs):
                if rng.random() < exchange_rate:
                    one[i], other[i] = other[i], one[i]
            _legalize(one, order, holder, free, rng)
            _legalize(other, order, holder, free, rng)
            bred += 2
    for _ in range(size):
        parent = int(rng.random() * size)
        if rng.random() < mutation_rate:
            offspring[bred] = population[parent]
            changing = True
            while changing:
                _replace(offspring[bred], argument_pairs, rng)
                changing = rng.random() < 0.5
            bred += 1
    return bred


@kernel
def judge_object_maps(
    population: IntArray,
    fitness: FloatArray,
    offspring: IntArray,
    pairs: IntArray,
    columns: IntArray,
    relations: Relations,
) -> None:
    """Let offspring compete with the population, which stays sorted, the fittest first.

    ``columns`` is the histogram correspondence of each ordered argument pair (N', N'), and
    ``relations`` the relation table and the weights, as
    :func:`~sketchmatch.api.kernels.fmap_confidence` takes them.
    """
    entries = np.empty(pairs.shape[0], dtype=np.int64)
    scratch = np.empty(pairs.shape[0])
    for k in range(offspring.shape[0]):
        child = offspring[k]
        for i in range(entries.size):
            entries[i] = columns[child[pairs[i, 0]], child[pairs[i, 1]]]
        value = fmap_confidence_above(fitness[-1], entries, scratch, *relations)[0]
        _survive(population, fitness, child, value)


@kernel
def judge_pair_maps(
    population: IntArray, fitness: FloatArray, offspring: IntArray, relations: Relations
) -> None:
    """Let offspring compete with the population."""
    scratch = np.empty(offspring.shape[1])
    for k in range(offspring.shape[0]):
        child = offspring[k]
        value = fmap_confidence_above(fitness[-1], child, scratch, *relations)[0]
        _survive(population, fitness, child, value)


@kernel
def _draw(items: IntArray, place: int, rng: np.random.Generator) -> None:
    """Swap a random one of items[place:] to ``place``."""
    other = place + int(rng.random() * (items.size - place))
    items[place], items[other] = items[other], items[place]


@kernel
def _two(size: int, rng: np.random.Generator) -> tuple[int, int]:
    """Return two different random indices."""
    first = int(rng.random() * size)
    second = int(rng.random() * (size - 1))
    return first, second + (second >= first)


@kernel
def _mix(
    one: IntArray,
    other: IntArray,
    mask: NDArray[np.bool_],
    child: IntArray,
    pairs: IntArray,
    order: IntArray,
    holder: IntArray,
    free: IntArray,
    rng: np.random.Generator,
) -> None:
    """Cross two FMAPs, entry by entry, into one object-consistent child.

    The entries of the crossed FMAP are visited in random order. An entry (a, b) → (c, d) stays if
    it agrees with those that stayed before; all others change to what these imply. Template
    objects that no entry decides get random partners.
    """
    child[:] = -1
    holder[:] = -1
    missing = child.size
    for k in range(order.size):
        _draw(order, k, rng)
        i = order[k]
        source = other if mask[i] else one
        a, b = pairs[i, 0], pairs[i, 1]
        c, d = source[a], source[b]
        fits_a = child[a] == c or (child[a] < 0 and holder[c] < 0)
        fits_b = child[b] == d or (child[b] < 0 and holder[d] < 0)
        if fits_a and fits_b:
            missing -= (child[a] < 0) + (child[b] < 0)
            child[a], child[b] = c, d
            holder[c], holder[d] = a, b
            if missing == 0:
                return
    _complete(child, holder, free, rng)


@kernel
def _complete(child: IntArray, holder: IntArray, free: IntArray, rng: np.random.Generator) -> None:
    """Give random unused partners to the objects that have none."""
    count = 0
    for c in range(holder.size):
        if holder[c] < 0:
            free[count] = c
            count += 1
    place = 0
    for a in range(child.size):
        if child[a] < 0:
            _draw(free[:count], place, rng)
            child[a] = free[place]
            holder[free[place]] = a
            place += 1


@kernel
def _reassign(
    child: IntArray, pairs: IntArray, holder: IntArray, free: IntArray, rng: np.random.Generator
) -> None:
    """Change one entry of the FMAP at random and make all others agree with it.

    In half of the cases the new correspondence shares an object with the old one.
    """
    i = int(rng.random() * pairs.shape[0])
    a, b = pairs[i, 0], pairs[i, 1]
    holder[:] = -1
    for k in range(child.size):
        holder[child[k]] = k
    c = int(rng.random() * holder.size)
    d = child[b]
    if c == d or rng.random() < 0.5:
        d = int(rng.random() * (holder.size - 1))
        d += d >= c
    for k in (a, b):
        holder[child[k]] = -1
    for k in (holder[c], holder[d]):
        if k >= 0:
            child[k] = -1
    child[a], child[b] = c, d
    holder[c], holder[d] = a, b
    _complete(child, holder, free, rng)


@kernel
def _legalize(
    child: IntArray, order: IntArray, holder: IntArray, free: IntArray, rng: np.random.Generator
) -> None:
    """Change conflicting entries at random until no argument pair is used twice."""
    pairs = holder.size
    holder[:] = -1
    conflicts = 0
    for k in range(order.size):
        _draw(order, k, rng)
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
        _draw(free[:count], k, rng)
        child[order[k]] = free[k] + pairs * (rng.random() < 0.5)


@kernel
def _replace(child: IntArray, argument_pairs: int, rng: np.random.Generator) -> None:
    """Change one entry at random, and the entry that it conflicts with to what it frees."""
    place = int(rng.random() * child.size)
    value = int(rng.random() * 2 * argument_pairs)
    for i in range(child.size):
        if i != place and child[i] % argument_pairs == value % argument_pairs:
            child[i] = child[place] % argument_pairs + argument_pairs * (rng.random() < 0.5)
    child[place] = value


@kernel
def _survive(population: IntArray, fitness: FloatArray, child: IntArray, value: float) -> None:
    """Put a child in its place in the sorted population, unless it is worse than all or known."""
    size = fitness.size
    if value <= fitness[size - 1]:
        return
    place = size - 1
    while place > 0 and fitness[place - 1] < value:
        place -= 1
    same = place - 1
    while same >= 0 and fitness[same] == value:
        if np.all(population[same] == child):
            return
        same -= 1
    for k in range(size - 1, place, -1):
        fitness[k] = fitness[k - 1]
        population[k] = population[k - 1]
    fitness[place] = value
    population[place] = child
