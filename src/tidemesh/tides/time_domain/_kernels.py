"""Compiled loops of the time step.

Node fields are rows of one array ``state`` (FIELDS, n_points), nodes in the order of
`Discretisation`. Loops over triangles write one row of ``share`` each and loops over
nodes gather them, so that nothing depends on how the loops are cut into blocks. Indices
are unsigned, which spares the test for negative ones.
"""

from __future__ import annotations

import math
from types import FunctionType

import numpy as np
from numba import njit, prange

U32 = np.uint32
THIRD = 1.0 / 3.0
BLOCK = 512
"""Triangles or nodes of a block, the piece of work of a thread."""

(
    LEVEL,  # elevation, m
    U,  # velocity, m/s
    V,
    QX,  # velocity times water column, m2/s
    QY,
    RISE,  # change of the elevation in the last step, m
    SX,  # (tau0 - tau) Q - f k x Q, m2/s2
    SY,
    AX,  # - dt times advection (and viscosity), m/s
    AY,
    PX,  # - dt/2 g times the gradient of the elevation, m/s
    PY,
    TAU,  # friction, 1/s
    HEAD,  # elevation less equilibrium tide, m
    TIDE,  # equilibrium tide, m
    FILMS,  # number of steps that ended at the minimum water column
) = range(16)
FIELDS = 16

(
    DEPTH,  # m
    INVERSE,  # 1 over the weight of the new elevation in the wave equation, s2/m2
    AROUND,  # - dt over the area of the triangles around a node, s/m2
    FRICTION,  # linear part of tau, 1/s
    DRAG,  # C_f
    ROUGHNESS,  # g n^2 of Manning's law, m^(1/3)
    CORIOLIS,  # f, 1/s
    LOWEST,  # lowest elevation: the minimum water column less the depth, m
    SPIN,  # f, zero where the velocity is bound to the shore
    ALONG_XX,  # projection of the velocity on the shore; unity off it, zero where
    ALONG_XY,  # nothing flows
    ALONG_YY,
) = range(12)
CONSTANTS = 12

# Coefficients of Manning's law follow the depth every so many steps.
MANNING_EVERY = 16

_OPTIONS = {"cache": True, "error_model": "numpy", "fastmath": {"contract", "nsz"}}


@njit(**_OPTIONS)
def triangles_pass(
    first,
    last,
    corners,
    geometry,
    state,
    share,
    gravity,
    finite,
    advection,
    viscosity,
    step,
    tide,
):
    """Terms of the wave equation and the advection, triangle by triangle.

    ``geometry`` rows: x derivatives of basis functions 2 and 3, their y derivatives,
    area, g times the mean depth, weight in the means at nodes, part of the advection
    that counts. ``share`` columns: what the three corners get in the wave equation
    (m3/s2), weight times advection along x and y (m3/s2), and with viscosity what the
    corners get along x, and along y.
    """
    half = 0.5 * gravity * finite
    rate = 1.0 / (3.0 * step)
    for k in range(last - first):
        t = U32(first + k)
        a, b, c = corners[t, 0], corners[t, 1], corners[t, 2]
        bx, cx, by, cy = geometry[0, t], geometry[1, t], geometry[2, t], geometry[3, t]
        area, depth, weight = geometry[4, t], geometry[5, t], geometry[6, t]
        ea, eb, ec = state[LEVEL, a], state[LEVEL, b], state[LEVEL, c]
        # g (h e_x + (e^2)_x / 2) by differences from the first corner.
        to_b = (eb - ea) * (depth + half * (ea + eb))
        to_c = (ec - ea) * (depth + half * (ea + ec))
        fx = (state[SX, a] + state[SX, b] + state[SX, c]) * THIRD
        fy = (state[SY, a] + state[SY, b] + state[SY, c]) * THIRD
        fx -= bx * to_b + cx * to_c
        fy -= by * to_b + cy * to_c
        if tide:
            column = depth + half * (2.0 / 3.0) * (ea + eb + ec)
            to_b = column * (state[TIDE, b] - state[TIDE, a])
            to_c = column * (state[TIDE, c] - state[TIDE, a])
            fx += bx * to_b + cx * to_c
            fy += by * to_b + cy * to_c
        if finite:
            # The flux H u changes with the column too: u dz/dt, without which the wave
            # equation would not conserve mass from node to node.
            rise = (state[RISE, a] + state[RISE, b] + state[RISE, c]) * rate
            fx += rise * (state[U, a] + state[U, b] + state[U, c]) * THIRD
            fy += rise * (state[V, a] + state[V, b] + state[V, c]) * THIRD
        if advection:
            ua, va = state[U, a], state[V, a]
            ub, vb = state[U, b] - ua, state[V, b] - va
            uc, vc = state[U, c] - ua, state[V, c] - va
            u, v = ua + (ub + uc) * THIRD, va + (vb + vc) * THIRD
            qx = (state[QX, a] + state[QX, b] + state[QX, c]) * THIRD
            qy = (state[QY, a] + state[QY, b] + state[QY, c]) * THIRD
            ux, uy = bx * ub + cx * uc, by * ub + cy * uc
            vx, vy = bx * vb + cx * vc, by * vb + cy * vc
            part = geometry[7, t]
            fx -= part * (qx * ux + qy * uy)
            fy -= part * (qx * vx + qy * vy)
            part *= weight
            share[t, 3] = part * (u * ux + v * uy)
            share[t, 4] = part * (u * vx + v * vy)
        if viscosity > 0.0:
            # Kolar & Gray's form in the wave equation, Galerkin's in the momentum.
            ub, uc = state[U, b] - state[U, a], state[U, c] - state[U, a]
            vb, vc = state[V, b] - state[V, a], state[V, c] - state[V, a]
            to_b = viscosity / step * (state[RISE, b] - state[RISE, a])
            to_c = viscosity / step * (state[RISE, c] - state[RISE, a])
            fx -= bx * to_b + cx * to_c
            fy -= by * to_b + cy * to_c
            ux, uy = bx * ub + cx * uc, by * ub + cy * uc
            vx, vy = bx * vb + cx * vc, by * vb + cy * vc
            stress = 3.0 * viscosity * weight
            share[t, 6] = stress * (bx * ux + by * uy)
            share[t, 7] = stress * (cx * ux + cy * uy)
            share[t, 9] = stress * (bx * vx + by * vy)
            share[t, 10] = stress * (cx * vx + cy * vy)
            share[t, 5] = -(share[t, 6] + share[t, 7])
            share[t, 8] = -(share[t, 9] + share[t, 10])
        fx *= area
        fy *= area
        to_b, to_c = bx * fx + by * fy, cx * fx + cy * fy
        share[t, 0], share[t, 1], share[t, 2] = -(to_b + to_c), to_b, to_c


@njit(**_OPTIONS)
def elevation_pass(
    first,
    last,
    starts,
    members,
    share,
    state,
    constants,
    keep,
    advection,
    viscosity,
    limit,
    tally,
):
    """New elevations at the nodes, and what the triangles leave for the momentum.

    ``tally``: first node beyond the limit (-1 for none), and the sum over all films of
    the rise that makes them, over INVERSE.
    """
    for k in range(last - first):
        i = U32(first + k)
        load, x, y = 0.0, 0.0, 0.0
        for m in range(starts[i], starts[i + U32(1)]):
            t, corner = members[m, 0], members[m, 1]
            load += share[t, corner]
            if viscosity > 0.0:
                x += share[t, corner + U32(5)]
                y += share[t, corner + U32(8)]
            if advection:
                x += share[t, 3]
                y += share[t, 4]
        rise = keep * state[RISE, i] + constants[INVERSE, i] * load
        level = state[LEVEL, i] + rise
        if level < constants[LOWEST, i]:
            short = constants[LOWEST, i] - level
            state[FILMS, i] += 1.0
            tally[1] += short / constants[INVERSE, i]
            level += short
            rise += short
        if not abs(level) <= limit and tally[0] < 0.0:
            tally[0] = first + k
        state[RISE, i] = rise
        state[LEVEL, i] = level
        state[AX, i] = x * constants[AROUND, i]
        state[AY, i] = y * constants[AROUND, i]


@njit(**_OPTIONS)
def gradient_pass(first, last, starts, others, weights, state, head):
    """What the slope of the row ``head`` adds to the velocities in half a step."""
    for k in range(last - first):
        i = U32(first + k)
        x, y = 0.0, 0.0
        for m in range(starts[i], starts[i + U32(1)]):
            value = state[head, others[m]]
            x += weights[m, 0] * value
            y += weights[m, 1] * value
        state[AX, i] += state[PX, i] + x
        state[AY, i] += state[PY, i] + y
        state[PX, i], state[PY, i] = x, y


@njit(**_OPTIONS)
def manning_pass(first, last, state, constants, finite):
    """Coefficients of Manning's law by the water column."""
    for i in range(first, last):
        column = constants[DEPTH, i] + finite * state[LEVEL, i]
        constants[DRAG, i] = constants[ROUGHNESS, i] / column ** (1.0 / 3.0)


@njit(**_OPTIONS)
def momentum_pass(first, last, state, constants, step, tau0, finite):
    """New velocities, and with them friction, flux and its part in the wave equation.

    Without branches and on rows cut to the block, so that the compiler takes several
    nodes at a time.
    """
    cap = 2.0 / step
    us, vs, taus = state[U][first:last], state[V][first:last], state[TAU][first:last]
    xs, ys = state[AX][first:last], state[AY][first:last]
    levels = state[LEVEL][first:last]
    qxs, qys = state[QX][first:last], state[QY][first:last]
    sxs, sys = state[SX][first:last], state[SY][first:last]
    depth, friction = constants[DEPTH][first:last], constants[FRICTION][first:last]
    drag, coriolis = constants[DRAG][first:last], constants[CORIOLIS][first:last]
    spin, along_xx = constants[SPIN][first:last], constants[ALONG_XX][first:last]
    along_xy, along_yy = (
        constants[ALONG_XY][first:last],
        constants[ALONG_YY][first:last],
    )
    for i in range(len(us)):
        u, v = us[i], vs[i]
        a, b = 0.5 * step * taus[i], 0.5 * step * spin[i]
        x = xs[i] + (1.0 - a) * u + b * v
        y = ys[i] + (1.0 - a) * v - b * u
        a += 1.0
        scale = 1.0 / (a * a + b * b)
        u, v = scale * (a * x + b * y), scale * (a * y - b * x)
        x = along_xx[i] * u + along_xy[i] * v
        y = along_xy[i] * u + along_yy[i] * v
        column = depth[i] + finite * levels[i]
        tau = friction[i] + drag[i] * math.sqrt(x * x + y * y) / column
        tau = min(tau, cap)
        rest, f = tau0 - tau, coriolis[i]
        us[i] = x
        vs[i] = y
        taus[i] = tau
        x *= column
        y *= column
        qxs[i] = x
        qys[i] = y
        sxs[i] = rest * x + f * y
        sys[i] = rest * y - f * x


@njit(**_OPTIONS)
def tide_pass(first, last, real, imaginary, cosine, sine, state):
    """Equilibrium tide of the new time: Re of amplitudes times phase factors."""
    for k in range(last - first):
        i = U32(first + k)
        total = 0.0
        for c in range(real.shape[0]):
            total += real[c, i] * cosine[c] - imaginary[c, i] * sine[c]
        state[TIDE, i] = total


@njit(**_OPTIONS)
def head_pass(first, last, state):
    """Elevation less equilibrium tide."""
    for k in range(last - first):
        i = U32(first + k)
        state[HEAD, i] = state[LEVEL, i] - state[TIDE, i]


def advance(
    steps,
    begin,
    step,
    tau0,
    gravity,
    finite,
    advection,
    viscosity,
    manning,
    limit,
    corners,
    geometry,
    incidence,
    members,
    starts,
    others,
    weights,
    state,
    constants,
    share,
    ocean,
    ocean_real,
    ocean_imaginary,
    ocean_lowest,
    tide_real,
    tide_imaginary,
    frequency,
    argument,
    factor,
    ramp,
    tally,
):
    """Take some steps; the number taken, fewer where a node left the limit.

    Parameters
    ----------
    steps, begin : int
        Number of steps, and that of the first one since the start of the run.
    frequency, argument, factor : (n_c,) arrays
        Of the forcing: rad/s, rad, nodal factor.
    ramp : float
        s; 0 for none.
    tally : (n_blocks, 2) array
        See `elevation_pass`.
    """
    n_triangles, n_points = corners.shape[0], state.shape[1]
    triangle_blocks = (n_triangles + BLOCK - 1) // BLOCK
    node_blocks = (n_points + BLOCK - 1) // BLOCK
    keep = (1.0 / step - 0.5 * tau0) / (1.0 / step + 0.5 * tau0)
    tide = tide_real.shape[0] > 0
    head = HEAD if tide else LEVEL
    before = np.empty(len(ocean))
    cosine, sine = np.empty(len(frequency)), np.empty(len(frequency))
    for s in range(steps):
        time = (begin + s + 1) * step
        growth = math.tanh(2.0 * time / ramp) if ramp > 0.0 else 1.0
        for c in range(len(frequency)):
            phase = frequency[c] * time + argument[c]
            cosine[c] = growth * factor[c] * math.cos(phase)
            sine[c] = growth * factor[c] * math.sin(phase)
        for q in prange(triangle_blocks):
            triangles_pass(
                q * BLOCK,
                min(n_triangles, (q + 1) * BLOCK),
                corners,
                geometry,
                state,
                share,
                gravity,
                finite,
                advection,
                viscosity,
                step,
                tide,
            )
        for k in range(len(ocean)):
            before[k] = state[LEVEL, ocean[k]]
        for q in prange(node_blocks):
            elevation_pass(
                q * BLOCK,
                min(n_points, (q + 1) * BLOCK),
                incidence,
                members,
                share,
                state,
                constants,
                keep,
                advection,
                viscosity,
                limit,
                tally[q],
            )
        for k in range(len(ocean)):
            i = ocean[k]
            level = 0.0
            for c in range(len(frequency)):
                level += ocean_real[c, k] * cosine[c]
                level -= ocean_imaginary[c, k] * sine[c]
            if level < ocean_lowest[k]:
                level = ocean_lowest[k]
                state[FILMS, i] += 1.0
            state[LEVEL, i] = level
            state[RISE, i] = level - before[k]
        if tide:
            for q in prange(node_blocks):
                last = min(n_points, (q + 1) * BLOCK)
                tide_pass(
                    q * BLOCK,
                    last,
                    tide_real,
                    tide_imaginary,
                    cosine,
                    sine,
                    state,
                )
                head_pass(q * BLOCK, last, state)
        refresh = manning and (begin + s) % MANNING_EVERY == 0
        for q in prange(node_blocks):
            first, last = q * BLOCK, min(n_points, (q + 1) * BLOCK)
            gradient_pass(first, last, starts, others, weights, state, head)
            if refresh:
                manning_pass(first, last, state, constants, finite)
            momentum_pass(first, last, state, constants, step, tau0, finite)
        for q in range(node_blocks):
            if tally[q, 0] >= 0.0:
                return s + 1
    return steps


def _named(function, name):
    """The function under another name: numba caches by name, whatever the options."""
    return FunctionType(
        function.__code__.replace(co_name=name, co_qualname=name),
        function.__globals__,
        name,
    )


advance_alone = njit(**_OPTIONS)(_named(advance, "advance_alone"))
advance_together = njit(parallel=True, **_OPTIONS)(_named(advance, "advance_together"))


@njit(cache=True, error_model="numpy", fastmath={"contract"})
def accumulate(sums, basis, samples):
    """Add samples (k, m) times basis values (k, p) to the sums (p, m), in order."""
    size = samples.shape[1]
    for first in range(0, size, BLOCK):
        last = min(size, first + BLOCK)
        for s in range(samples.shape[0]):
            for p in range(basis.shape[1]):
                factor = basis[s, p]
                for i in range(first, last):
                    sums[p, i] += factor * samples[s, i]
