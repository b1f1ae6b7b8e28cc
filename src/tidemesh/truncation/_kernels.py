"""Compiled loops of the local polynomial fits."""

from __future__ import annotations

import math

import numpy as np
from numba import njit


@njit(cache=True)
def gather_rings(nodes, indptr, indices, target, most_rings, mark, patches, counts):
    """Fill rows of ``patches`` ring by ring until they hold ``target`` points."""
    capacity = patches.shape[1]
    for k in range(nodes.shape[0]):
        mark[nodes[k]] = k
        patches[k, 0] = nodes[k]
        count = 1
        ring_start = 0
        rings = 0
        while count < target[k] and rings < most_rings and ring_start < count:
            ring_end = count
            for p in range(ring_start, ring_end):
                node = patches[k, p]
                for q in range(indptr[node], indptr[node + 1]):
                    other = indices[q]
                    if mark[other] != k and count < capacity:
                        mark[other] = k
                        patches[k, count] = other
                        count += 1
            ring_start = ring_end
            rings += 1
        counts[k] = count


@njit(cache=True)
def fit_patches(
    points,
    values,
    patches,
    counts,
    parent,
    by_x,
    turn,
    tolerance,
    frame,
    kept,
    solution,
):
    """Weighted Householder fit of every patch, in the frame of the patch.

    Monomial t is monomial ``parent[t]`` times x where ``by_x[t]``, times y elsewhere.
    ``frame`` receives the centre (x, y), the radius, and cosine and sine of the long
    axis (of the x axis if ``turn`` is False). A monomial whose column lies within
    ``tolerance`` (sine of the angle) of the span of those before it is left out:
    ``kept`` is False and its coefficients are zero.
    """
    terms = parent.shape[0]
    sides = values.shape[1]
    columns = terms + sides
    a = np.empty((patches.shape[1], columns))
    work = np.empty(columns)
    norm = np.empty(terms)
    diagonal = np.empty(terms)
    pivot = np.empty(terms, dtype=np.int64)

    for k in range(patches.shape[0]):
        rows = counts[k]
        origin_x = points[patches[k, 0], 0]
        origin_y = points[patches[k, 0], 1]
        centre_x = 0.0
        centre_y = 0.0
        radius = 0.0
        for i in range(rows):
            dx = points[patches[k, i], 0] - origin_x
            dy = points[patches[k, i], 1] - origin_y
            centre_x += dx
            centre_y += dy
            radius = max(radius, dx * dx + dy * dy)
        centre_x /= rows
        centre_y /= rows
        # Monomials are best told apart about the middle of the patch; about the node
        # itself nothing has to be shifted back.
        if centre_x * centre_x + centre_y * centre_y < 0.04 * radius:
            centre_x = 0.0
            centre_y = 0.0
        radius = math.sqrt(radius) if radius > 0.0 else 1.0
        cosine = 1.0
        sine = 0.0
        if turn:
            xx = 0.0
            xy = 0.0
            yy = 0.0
            for i in range(rows):
                dx = (points[patches[k, i], 0] - origin_x - centre_x) / radius
                dy = (points[patches[k, i], 1] - origin_y - centre_y) / radius
                xx += dx * dx
                xy += dx * dy
                yy += dy * dy
            angle = 0.5 * math.atan2(2.0 * xy, xx - yy)
            cosine = math.cos(angle)
            sine = math.sin(angle)
        frame[k, 0] = centre_x
        frame[k, 1] = centre_y
        frame[k, 2] = radius
        frame[k, 3] = cosine
        frame[k, 4] = sine

        for t in range(terms):
            norm[t] = 0.0
        for i in range(rows):
            node = patches[k, i]
            dx = (points[node, 0] - origin_x) / radius
            dy = (points[node, 1] - origin_y) / radius
            weight = math.exp(-(dx * dx + dy * dy))
            dx -= centre_x / radius
            dy -= centre_y / radius
            x = cosine * dx + sine * dy
            y = cosine * dy - sine * dx
            row = a[i]
            row[0] = weight
            for t in range(1, terms):
                row[t] = row[parent[t]] * (x if by_x[t] else y)
            for t in range(terms):
                norm[t] += row[t] * row[t]
            for s in range(sides):
                row[terms + s] = weight * values[node, s]

        # A fit that all but interpolates its points amplifies their errors.
        limit = max(1, (4 * rows) // 5)
        rank = 0
        for j in range(terms):
            rest = 0.0
            for i in range(rank, rows):
                rest += a[i, j] * a[i, j]
            if rank >= limit or rest <= tolerance * tolerance * norm[j]:
                pivot[j] = -1
                kept[k, j] = False
                continue
            head = a[rank, j]
            diagonal[j] = -math.sqrt(rest) if head > 0.0 else math.sqrt(rest)
            beta = 1.0 / (rest - head * diagonal[j])
            a[rank, j] = head - diagonal[j]
            # Inner loops run along rows, so they vectorise without reordering sums;
            # on views, since index arithmetic would take half of the time.
            later = work[: columns - j - 1]
            for c in range(later.shape[0]):
                later[c] = 0.0
            for i in range(rank, rows):
                factor = beta * a[i, j]
                row = a[i, j + 1 :]
                for c in range(row.shape[0]):
                    later[c] += factor * row[c]
            for i in range(rank, rows):
                factor = a[i, j]
                row = a[i, j + 1 :]
                for c in range(row.shape[0]):
                    row[c] -= factor * later[c]
            pivot[j] = rank
            kept[k, j] = True
            rank += 1

        for j in range(terms - 1, -1, -1):
            found = solution[k, j]
            for s in range(sides):
                found[s] = 0.0 if pivot[j] < 0 else a[pivot[j], terms + s]
            if pivot[j] < 0:
                continue
            row = a[pivot[j]]
            for c in range(j + 1, terms):
                other = solution[k, c]
                for s in range(sides):
                    found[s] -= row[c] * other[s]
            for s in range(sides):
                found[s] /= diagonal[j]


@njit(cache=True)
def evaluate(coefficients, rows, offset, parent, by_x, values):
    """Values of polynomials ``rows`` at offsets from their nodes."""
    terms = parent.shape[0]
    monomials = np.ones(terms)
    for k in range(rows.shape[0]):
        for t in range(1, terms):
            monomials[t] = monomials[parent[t]] * offset[k, 0 if by_x[t] else 1]
        found = values[k]
        for s in range(found.shape[0]):
            found[s] = 0.0
        for t in range(terms):
            term = coefficients[rows[k], t]
            for s in range(found.shape[0]):
                found[s] += monomials[t] * term[s]
