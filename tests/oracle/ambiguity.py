"""Which maps contradict each other, and what a question about one object tells, by loops.

A map here is a dictionary from sketched to mapped objects.
"""

import math

__all__ = ["contradict", "expected_reduction", "sharing"]


def contradict(first, second):
    """Return whether two maps say different things of who is who."""
    return any(
        (a == c) != (b == d) for a, b in first.items() for c, d in second.items()
    )  # one object with two partners, or one partner of two objects


def sharing(maps, probabilities):
    """Return which maps, by index, share the probability with the first."""
    chosen = []
    for k, (one, probability) in enumerate(zip(maps, probabilities, strict=True)):
        if 2.0 * probability >= probabilities[0] > 0.0 and all(
            contradict(one, maps[other]) for other in chosen
        ):
            chosen.append(k)
    return chosen


def entropy(probabilities):
    total = sum(probabilities)
    return sum(-p / total * math.log(p / total) for p in probabilities if p > 0.0)


def expected_reduction(maps, probabilities, sketch_object):
    """Return by how much the partner of an object reduces the entropy over maps, on average."""
    answers = {one.get(sketch_object) for one in maps}
    left = 0.0
    for answer in answers:
        agreeing = [
            p
            for one, p in zip(maps, probabilities, strict=True)
            if one.get(sketch_object) == answer
        ]
        left += sum(agreeing) / sum(probabilities) * entropy(agreeing)
    return entropy(probabilities) - left
