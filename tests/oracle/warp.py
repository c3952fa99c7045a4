"""The warp as a Gaussian process over real numbers, point by point and entry by entry."""

import numpy as np


def thin_plate(a, b):
    """Return r² ln r of two points."""
    r = np.hypot(*(a - b))
    return r * r * np.log(r) if r > 0.0 else 0.0


def bent(a, b, nodes):
    """Return the covariance of the spline at two points, without what is affine at the nodes."""
    planes = np.array([[1.0, x, y] for x, y in nodes])
    shares = [np.linalg.pinv(planes).T @ np.array([1.0, *point]) for point in (a, b)]
    total = thin_plate(a, b)
    for i, node in enumerate(nodes):
        total -= shares[0][i] * thin_plate(node, b) + shares[1][i] * thin_plate(a, node)
        for j, other in enumerate(nodes):
            total += shares[0][i] * shares[1][j] * thin_plate(node, other)
    return total


def near(a, b, reach):
    """Return Wendland's function of two points' distance."""
    d = np.hypot(*(a - b)) / reach
    return (1.0 - d) ** 4 * (4.0 * d + 1.0) if d < 1.0 else 0.0


def krige(nodes, goals, points, weights, *, stretch, bend, shared, reach):
    """Return where points come to, and their variances in units of an object's own variance.

    Of turn, scale and shift nothing is known; the others are drawn from what the arguments say: a
    stretch v of w = v·conj(z), a spline, displacements that are shared, and others.
    """

    def rigid(p):
        return np.array([[p[0], -p[1], 1.0, 0.0], [p[1], p[0], 0.0, 1.0]])

    def sheared(p):
        return np.array([[p[0], p[1]], [-p[1], p[0]]])

    def covariance(a, b):
        scalar = bend * bent(a, b, nodes) + shared * near(a, b, reach)
        return stretch * sheared(a) @ sheared(b).T + scalar * np.eye(2)

    known = np.block([[covariance(a, b) for b in nodes] for a in nodes])
    known += np.kron(np.diag(1.0 / weights - shared), np.eye(2))
    trend, seen = np.vstack([rigid(a) for a in nodes]), np.ravel(goals)
    inverse = np.linalg.inv(known)
    spread = np.linalg.inv(trend.T @ inverse @ trend)
    pose = spread @ trend.T @ inverse @ seen
    places, variances = [], []
    for point in points:
        with_nodes = np.hstack([covariance(point, node) for node in nodes])
        places.append(rigid(point) @ pose + with_nodes @ inverse @ (seen - trend @ pose))
        left = rigid(point) - with_nodes @ inverse @ trend
        own = covariance(point, point) + (1.0 - shared) * np.eye(2)
        variances.append(own - with_nodes @ inverse @ with_nodes.T + left @ spread @ left.T)
    return np.array(places), np.array([np.trace(each) / 2.0 for each in variances])
