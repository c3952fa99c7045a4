"""What alignment computes, slow and obvious: nothing compiled, no grid, all maps tried."""

import itertools
import math

import numpy as np
import shapely

GROWTH = -1.0, 2.0
"""Within which things may grow beyond what their places do, in ln of the area."""


def moments(item):
    """Return area, centroid and central second moments by area, from triangles of a polygon."""
    area, first, second = 0.0, np.zeros(2), np.zeros((2, 2))
    for triangle in shapely.constrained_delaunay_triangles(item.polygon).geoms:
        corners = np.array(triangle.exterior.coords[:3])
        middle, part = corners.mean(axis=0), triangle.area
        area += part
        first += part * middle
        # ∫ r rᵀ over a triangle: A/12 (Σ cᵢcᵢᵀ + 9 m mᵀ).
        second += part / 12.0 * (corners.T @ corners + 9.0 * np.outer(middle, middle))
    centre = first / area
    return area, centre, second / area - np.outer(centre, centre)


def shape(covariance):
    """Return ½ ln(λ₁/λ₂)·e^{2iφ} of a covariance."""
    values, vectors = np.linalg.eigh(covariance)
    x, y = vectors[:, 1]
    return 0.5 * math.log(values[1] / values[0]) * np.exp(2j * math.atan2(y, x))


def spacing(places):
    """Return the mean distance to the nearest other place."""
    return float(
        np.mean(
            [min(abs(a - b) for j, b in enumerate(places) if j != i) for i, a in enumerate(places)]
        )
    )


def worths(pose, drawn, mapped, tolerances, bonus=None):
    """Return ℓ of every pairing under a pose."""
    u, t, growth = pose
    found = np.empty((len(drawn.places), len(mapped.places)))
    for i, j in np.ndindex(found.shape):
        d = abs(mapped.places[j] - u * drawn.places[i] - t) / (abs(u) * drawn.spacing)
        e = mapped.sizes[j] - drawn.sizes[i] - growth
        h = abs(mapped.shapes[j] - drawn.shapes[i] * (u / abs(u)) ** 2)
        terms = d / tolerances.place, e / tolerances.size, h / tolerances.shape
        found[i, j] = -2.0 * sum(math.log(1.0 + x * x / 3.0) for x in terms)
    return found if bonus is None else found + bonus


def pose_worth(pose, drawn, mapped, allowed, tolerances):
    """Return Σ_i max(max_j ℓ_ij, −λ)."""
    found = np.where(allowed, worths(pose, drawn, mapped, tolerances), -np.inf)
    return float(np.maximum(found.max(axis=1), -tolerances.omission).sum())


def guesses(pairs, drawn, mapped, allowed):
    """Yield i, j, k, g and the pose of each two pairings that may make one."""
    for i, k in pairs:
        for j, g in itertools.permutations(range(len(mapped.places)), 2):
            way, other = drawn.places[k] - drawn.places[i], mapped.places[g] - mapped.places[j]
            if way == 0.0 or other == 0.0 or not (allowed[i, j] and allowed[k, g]):
                continue
            u = other / way
            first, second = mapped.sizes[j] - drawn.sizes[i], mapped.sizes[g] - drawn.sizes[k]
            grown = 2.0 * math.log(abs(u))
            twist = (u / abs(u)) ** 2
            if (
                abs(first - second) <= 3.0 * 0.35
                and GROWTH[0] <= (first + second) / 2.0 - grown <= GROWTH[1]
                and abs(drawn.shapes[i] * twist - mapped.shapes[j]) <= 3.0 * 0.35
                and abs(drawn.shapes[k] * twist - mapped.shapes[g]) <= 3.0 * 0.35
            ):
                growth = grown + 0.9 * ((first + second) / 2.0 - grown)
                yield (i, j, k, g), (u, mapped.places[j] - u * drawn.places[i], growth)


def all_maps(n, m):
    """Yield every map of n objects to m, none of which two share; −1 for none."""
    for partners in itertools.product(range(-1, m), repeat=n):
        used = [j for j in partners if j >= 0]
        if len(used) == len(set(used)):
            yield partners


def value(partners, found, omission):
    """Return the sum of ℓ and −λ."""
    return sum(found[i, j] if j >= 0 else -omission for i, j in enumerate(partners))


def changed(partners, n, m):
    """Return every map that one change makes: of one object, or of two over a partner taken.

    The second is the one that had the partner that the first now has.
    """
    start, found = tuple(partners), set()
    for i, j in itertools.product(range(n), range(-1, m)):
        if j == start[i]:
            continue
        k = start.index(j) if j >= 0 and j in start else None
        for g in range(-1, m) if k is not None else (None,):
            after = list(start)
            after[i] = j
            if k is not None:
                after[k] = g
            used = [x for x in after if x >= 0]
            if len(used) == len(set(used)):
                found.add(tuple(after))
    found.discard(start)
    return found


def best_pose(partners, drawn, mapped, tolerances, steps=3):
    """Return the pose of a map: least squares first, then weighed by how well each line fits."""
    lines = [(i, j) for i, j in enumerate(partners) if j >= 0]
    z = np.array([drawn.places[i] for i, _ in lines])
    w = np.array([mapped.places[j] for _, j in lines])
    share = np.ones(len(lines))
    u = t = None
    least = 0.1 * math.sqrt(np.var(w) / np.var(z))
    for _ in range(steps + 1):
        a, b = np.average(z, weights=share), np.average(w, weights=share)
        v = np.sum(share * (w - b) * np.conj(z - a)) / np.sum(share * abs(z - a) ** 2)
        if u is None and abs(v) < least:
            v = v / abs(v) * least
        elif abs(v) < least:
            break
        u, t = v, b - v * a
        away = abs(w - u * z - t) / (abs(u) * drawn.spacing * tolerances.place)
        share = 1.0 / (1.0 + away**2 / 3.0)
    e = np.array([mapped.sizes[j] - drawn.sizes[i] for i, j in lines]) - 2.0 * math.log(abs(u))
    offset = 0.0
    for _ in range(3):
        share = 1.0 / (1.0 + ((e - offset) / tolerances.size) ** 2 / 3.0)
        offset = np.sum(share * e) / (np.sum(share) + (tolerances.size / 0.6) ** 2)
    return u, t, 2.0 * math.log(abs(u)) + offset


def lines(partners, drawn, mapped, tolerances):
    """Return what places, sizes and shapes say of each object with a partner, by name."""
    u, t, growth = best_pose(partners, drawn, mapped, tolerances)
    pairs = [(i, j) for i, j in enumerate(partners) if j >= 0]
    z = np.array([drawn.places[i] for i, _ in pairs])
    off = np.array([(mapped.places[j] - u * drawn.places[i] - t) / u for i, j in pairs])
    straightened = _bend(z, off / drawn.spacing, drawn.spacing)[1]
    spread = (abs(z - z.mean()) ** 2).sum()
    found = {}
    for k, (i, j) in enumerate(pairs):
        free = 1.0 - 1.0 / len(pairs) - abs(z[k] - z.mean()) ** 2 / spread
        nearest = min(abs(mapped.places[j] - each) for each in np.delete(mapped.places, j))
        left = (mapped.places[j] - u * drawn.places[i] - t) / u / drawn.spacing
        others = [line for line in pairs if line != (i, j)]
        others.sort(key=lambda line: abs(drawn.places[line[0]] - drawn.places[i]))
        ways = []
        for h, g in others:
            way = drawn.places[h] - drawn.places[i]
            ways.append(min(abs((mapped.places[g] - mapped.places[j]) / u / way - 1.0) ** 2, 1e4))
        found[i] = {
            "place": abs(left) ** 2,
            "size": mapped.sizes[j] - drawn.sizes[i] - growth,
            "shape": abs(drawn.shapes[i] * (u / abs(u)) ** 2 - mapped.shapes[j]) ** 2,
            "round": abs(mapped.shapes[j]),
            "way": np.mean(ways),
            "near": np.mean(ways[:2]),
            "alone": abs(left) ** 2 / max(free, 0.2) ** 2,
            "bent": abs(straightened[k]) ** 2,
            "room": (nearest / abs(u) / drawn.spacing) ** 2,
        }
    return found


def whole(partners, drawn, mapped, tolerances):
    """Return what places, sizes and shapes say of a map as a whole, by name."""
    u, t, growth = best_pose(partners, drawn, mapped, tolerances)
    pairs = [(i, j) for i, j in enumerate(partners) if j >= 0]
    found = worths((u, t, growth), drawn, mapped, tolerances)
    z = np.array([drawn.places[i] for i, _ in pairs])
    left = np.array([(mapped.places[j] - u * drawn.places[i] - t) / u for i, j in pairs])
    return {
        "score": value(partners, found, tolerances.omission),
        "matched": len(pairs),
        **_surrounded(partners, mapped, abs(u) * drawn.spacing),
        "offset": min((growth - 2.0 * math.log(abs(u))) ** 2, 6.0),
        "bend": _bend(z, left / drawn.spacing, drawn.spacing)[0],
    }


def related(partners, table):
    """Return what σ lacks of 1 for each object with a partner, in the mean over the others."""
    pairs = [(i, j) for i, j in enumerate(partners) if j >= 0]
    found = {}
    for i, j in pairs:
        rows = [object_pair(i, k, table.template_objects) for k, _ in pairs if k != i]
        columns = [object_pair(j, g, table.argument_objects) for _, g in pairs if g != j]
        found[i] = np.mean(1.0 - table.similarity[rows, columns])
    return found


def object_pair(a, b, objects):
    """Return the number of a pair of objects."""
    return list(itertools.combinations(range(objects), 2)).index((min(a, b), max(a, b)))


def _bend(z, left, unit):
    """Return how far a stretch and a growth to one side lead, by ridge regression, and the rest."""
    z = z - z.mean()
    extent = math.sqrt((abs(z) ** 2).mean())
    z, ratio = z / extent, extent / unit
    effects = [np.ones_like(z), 1j * np.ones_like(z), z.conj(), 1j * z.conj()]
    effects += [z * z.real, z * z.imag]
    weights = np.sqrt(1.0 / (1.0 + (abs(left) / 0.35) ** 2 / 3.0))
    design = np.array(effects).T * weights[:, None]
    stacked = np.concatenate([design.real, design.imag])
    ridge = np.diag([1e-3] * 2 + [math.hypot(1e-3, 0.2 / (0.12 * ratio))] * 4)
    sought = np.concatenate([(left * weights).real, (left * weights).imag, np.zeros(6)])
    found = np.linalg.lstsq(np.concatenate([stacked, ridge]), sought, rcond=None)[0]
    rest = left - np.array(effects).T @ found
    return min((found[2:] ** 2).sum() / (0.12 * ratio) ** 2, 9.0), rest


def _surrounded(partners, mapped, unit):
    """Return the objects that nobody drew amid others."""
    used = [j for j in partners if j >= 0]
    missing = crowd = 0.0
    for j in set(range(len(mapped.places))) - set(used):
        ways = np.array([mapped.places[other] - mapped.places[j] for other in used])
        crowd += (abs(ways) < 2.0 * unit).sum() >= 3
        if len(ways) < 3:
            continue
        angles = np.sort(np.angle(ways))
        gap = np.diff(np.append(angles, angles[0] + 2.0 * math.pi)).max()
        missing += np.clip((math.pi - gap) / (math.pi / 4.0), 0.0, 1.0)
    return {"missing": missing, "crowd": crowd}
