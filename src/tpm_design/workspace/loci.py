"""Euclidean distance from a region to a singularity locus within the closed reach of the mode.

The locus is the zero set of one determinant. Its signed distance to the region is positive outside and
negative inside, so the least one over the locus is the distance to the region or, where the locus cuts
it, minus the depth it comes to. Candidates come from feelers along the region's outward normals (the
way along a feeler is the distance) and from the lattice inside; each is then slid along the locus to
the nearest point.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tpm_design.arithmetic import inner, kernel
from tpm_design.mechanisms import equations
from tpm_design.mechanisms.pointwise import reach_row, singularity_row
from tpm_design.workspace.indices import determinant_at
from tpm_design.workspace.poses import workspace_margin
from tpm_design.workspace.region_geometry import PlacedRegion, nearest, perpendicular, signed_distance
from tpm_design.workspace.survey import Survey, crossings

CANDIDATES = 4
TRIES = 12
APART = 0.3
LEVELS = 200
SLIDES = 200
LONGEST_STEP = 10.0
GROWTH = 1.12
REACH_TOLERANCE = 1e-9
FINEST_STEP = 1e-6
ERROR_FLOOR = 1e-5
# a slide that ends nearer to a bound of the workspace than this share of its first step goes on along the rim
RIM_REACH = 0.1
RIM_STEPS = 12
RIM_DIFFERENCE = 1e-5


@dataclass(frozen=True)
class LocusDistance:
    """``value`` (m): distance, or minus the penetration depth. ``error`` (m). ``pose``: the locus point,
    None if no locus was met within reach (``value`` is then +inf)."""

    value: float
    error: float
    pose: tuple[float, float, float] | None


@inner
def _along(geometry, mode, part, base, normal, t):  # type: ignore[no-untyped-def]
    return determinant_at(
        geometry, mode, part, base[0] + t * normal[0], base[1] + t * normal[1], base[2] + t * normal[2]
    )


@inner
def _crossing(geometry, mode, part, base, normal, low, high):  # type: ignore[no-untyped-def]
    """Way along a feeler at which the determinant changes sign, by bisection."""
    positive = _along(geometry, mode, part, base, normal, low) > 0.0
    for _ in range(48):
        t = 0.5 * (low + high)
        if (_along(geometry, mode, part, base, normal, t) > 0.0) == positive:
            low = t
        else:
            high = t
    return 0.5 * (low + high)


@inner
def _exit(geometry, mode, base, normal, low, high):  # type: ignore[no-untyped-def]
    """Last way along a feeler that is still reachable, between ``low`` (reachable) and ``high``."""
    for _ in range(26):
        t = 0.5 * (low + high)
        margin = workspace_margin(
            geometry, mode, base[0] + t * normal[0], base[1] + t * normal[1], base[2] + t * normal[2]
        )
        if margin >= 0.0:
            low = t
        else:
            high = t
    return low


@inner
def _march(geometry, mode, determinant_count, part, bases, normals, step, limit):  # type: ignore[no-untyped-def]
    """Ways (F,) along the feelers to the first locus of one determinant; +inf where none was met before
    the march ended: one level after the first was met, or at ``limit``.

    Levels are spaced ever wider. The determinants continue past the leg space (the elbow term is clamped
    there), so a crossing beyond reach is found too, and discarded.
    """
    count = bases.shape[0]
    ways = np.full(count, math.inf)
    x, y, z = bases[:, 0].copy(), bases[:, 1].copy(), bases[:, 2].copy()
    legs, side = np.empty(count), np.empty(count)
    before, here = np.empty((determinant_count, count)), np.empty((determinant_count, count))
    singularity_row(geometry, mode, x, y, z, before)
    was_inside = np.ones(count, np.bool_)
    low, levels_left = 0.0, LEVELS
    while levels_left > 0 and low < limit:
        levels_left -= 1
        high = low + step
        for n in range(count):
            x[n] = bases[n, 0] + high * normals[n, 0]
            y[n] = bases[n, 1] + high * normals[n, 1]
            z[n] = bases[n, 2] + high * normals[n, 2]
        singularity_row(geometry, mode, x, y, z, here)
        reach_row(geometry, mode, x, y, z, legs, side)
        for n in range(count):
            inside = legs[n] >= 0.0 and side[n] >= 0.0
            if ways[n] == math.inf and (inside or was_inside[n]):
                base = (bases[n, 0], bases[n, 1], bases[n, 2])
                normal = (normals[n, 0], normals[n, 1], normals[n, 2])
                flipped = (here[part, n] > 0.0) != (before[part, n] > 0.0)
                ways[n] = _meeting(geometry, mode, part, base, normal, low, high, flipped, inside)
                if ways[n] < math.inf:
                    levels_left = min(levels_left, 1)
            was_inside[n] = inside
        before, here = here, before
        low = high
        step *= GROWTH
    return ways


@inner
def _meeting(geometry, mode, part, base, normal, low, high, flipped, inside):  # type: ignore[no-untyped-def]
    """Way at which a feeler meets the locus between two levels within closed reach, else +inf."""
    if not flipped:
        if inside:
            return math.inf
        # a locus may hug the shell that the feeler leaves through
        high = _exit(geometry, mode, base, normal, low, high)
        start = _along(geometry, mode, part, base, normal, low)
        if (_along(geometry, mode, part, base, normal, high) > 0.0) == (start > 0.0):
            return math.inf
    t = _crossing(geometry, mode, part, base, normal, low, high)
    margin = workspace_margin(
        geometry, mode, base[0] + t * normal[0], base[1] + t * normal[1], base[2] + t * normal[2]
    )
    return t if margin >= -REACH_TOLERANCE else math.inf


@inner
def _gradient(geometry, mode, part, x, y, z, step):  # type: ignore[no-untyped-def]
    gx = determinant_at(geometry, mode, part, x + step, y, z) - determinant_at(
        geometry, mode, part, x - step, y, z
    )
    gy = determinant_at(geometry, mode, part, x, y + step, z) - determinant_at(
        geometry, mode, part, x, y - step, z
    )
    gz = determinant_at(geometry, mode, part, x, y, z + step) - determinant_at(
        geometry, mode, part, x, y, z - step
    )
    size = math.sqrt(gx * gx + gy * gy + gz * gz)
    return gx, gy, gz, size


@inner
def _onto_locus(geometry, mode, part, point, normal, width):  # type: ignore[no-untyped-def]
    """(found, x, y, z): the point moved along ``normal`` onto the locus, by at most about ``width``."""
    x, y, z = point
    t0, t1 = 0.0, 0.01 * width
    g0 = determinant_at(geometry, mode, part, x, y, z)
    if abs(g0) <= 1e-12:
        return True, x, y, z
    g1 = determinant_at(geometry, mode, part, x + t1 * normal[0], y + t1 * normal[1], z + t1 * normal[2])
    for _ in range(12):
        if abs(g0) < abs(g1):
            t0, t1, g0, g1 = t1, t0, g1, g0
        if abs(g1) <= 1e-14 or g1 == g0:
            break
        t2 = t1 - g1 * (t1 - t0) / (g1 - g0)
        if not abs(t2) <= 2.0 * width:
            return False, x, y, z
        t0, g0 = t1, g1
        t1 = t2
        g1 = determinant_at(geometry, mode, part, x + t1 * normal[0], y + t1 * normal[1], z + t1 * normal[2])
    return abs(g1) <= 1e-10, x + t1 * normal[0], y + t1 * normal[1], z + t1 * normal[2]


@inner
def _try(geometry, mode, region, part, point, normal, width, best):  # type: ignore[no-untyped-def]
    found, x, y, z = _onto_locus(geometry, mode, part, point, normal, width)
    if found and workspace_margin(geometry, mode, x, y, z) >= -REACH_TOLERANCE:
        distance = signed_distance(region, x, y, z)
        if distance < best:
            return distance, x, y, z
    return best, math.nan, math.nan, math.nan


@inner
def _slide(geometry, mode, region, part, start, step, smallest):  # type: ignore[no-untyped-def]
    """Least signed distance along the locus from ``start``: (distance, x, y, z).

    First a step in the tangent plane towards the foot of the nearest region point (inside the region: of its
    centre), as long as the last two feet suggest (J. Barzilai, J. Borwein, Two-point step size gradient
    methods, IMA J. Numer. Anal. 8, 1988), then a compass in it that turns after each failure, so that no
    edge of the reach stops it for good.
    """
    x, y, z = start
    turn, failures = 0.0, 0
    wanted, touching = 1e-8 * step, ERROR_FLOOR * step
    stepped = False
    px, py, pz, qx, qy, qz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    difference = 1e-6 * step
    gx, gy, gz, size = _gradient(geometry, mode, part, x, y, z, difference)
    if not size > 0.0:
        return math.inf, x, y, z
    found, x, y, z = _onto_locus(geometry, mode, part, start, (gx / size, gy / size, gz / size), step)
    if not found or workspace_margin(geometry, mode, x, y, z) < -REACH_TOLERANCE:
        return math.inf, x, y, z
    best = signed_distance(region, x, y, z)
    for _ in range(SLIDES):
        if step <= smallest:
            break
        gx, gy, gz, size = _gradient(geometry, mode, part, x, y, z, difference)
        if not size > 0.0:
            break
        normal = (gx / size, gy / size, gz / size)
        outside = best > touching
        u = nearest(region, x, y, z) if outside else region.centre
        dx, dy, dz = u[0] - x, u[1] - y, u[2] - z
        along = dx * normal[0] + dy * normal[1] + dz * normal[2]
        dx, dy, dz = dx - along * normal[0], dy - along * normal[1], dz - along * normal[2]
        way = math.sqrt(dx * dx + dy * dy + dz * dz)
        if outside and way <= smallest:
            # the nearest region point lies along the normal: stationary
            break
        length = 1.0
        if stepped:
            sx, sy, sz = x - px, y - py, z - pz
            change = sx * (qx - dx) + sy * (qy - dy) + sz * (qz - dz)
            if change > 0.0:
                length = min(LONGEST_STEP, max(1.0 / LONGEST_STEP, (sx * sx + sy * sy + sz * sz) / change))
        px, py, pz, qx, qy, qz = x, y, z, dx, dy, dz
        point = (x + length * dx, y + length * dy, z + length * dz)
        trial = _try(geometry, mode, region, part, point, normal, max(length * way, step), best)
        if not trial[0] < best and length != 1.0:
            point = (x + dx, y + dy, z + dz)
            trial = _try(geometry, mode, region, part, point, normal, max(way, step), best)
        moved = trial[0] < best
        stepped = moved
        if not moved:
            ax, ay, az = perpendicular(normal)
            bx = normal[1] * az - normal[2] * ay
            by = normal[2] * ax - normal[0] * az
            bz = normal[0] * ay - normal[1] * ax
            for quarter in range(4):
                c = step * math.cos(turn + 0.5 * math.pi * quarter)
                s = step * math.sin(turn + 0.5 * math.pi * quarter)
                point = (x + c * ax + s * bx, y + c * ay + s * by, z + c * az + s * bz)
                trial = _try(geometry, mode, region, part, point, normal, step, best)
                if trial[0] < best:
                    moved = True
                    break
        if moved:
            gain = best - trial[0]
            best, x, y, z = trial
            failures = 0
            if gain < (wanted if stepped else 1e-4 * step):
                failures = 2
        else:
            failures += 1
            turn += 2.399963229728653
        if failures >= 2:
            step *= 0.35
            failures = 0
    return best, x, y, z


@inner
def _bound(geometry, mode, number, x, y, z):  # type: ignore[no-untyped-def]
    """One margin of the workspace: of the legs, then of the mode."""
    legs = equations.leg_margins(geometry, mode, x, y, z)
    if number < len(legs):
        return legs[number]
    return equations.mode_margins(geometry, mode, x, y, z)[number - len(legs)]


@inner
def _nearest_bound(geometry, mode, x, y, z):  # type: ignore[no-untyped-def]
    """(number of the least margin, its value)."""
    chosen, least, number = 0, math.inf, 0
    for margin in equations.leg_margins(geometry, mode, x, y, z):
        if margin < least:
            chosen, least = number, margin
        number += 1
    for margin in equations.mode_margins(geometry, mode, x, y, z):
        if margin < least:
            chosen, least = number, margin
        number += 1
    return chosen, least


@inner
def _bound_gradient(geometry, mode, number, x, y, z, h):  # type: ignore[no-untyped-def]
    gx = _bound(geometry, mode, number, x + h, y, z) - _bound(geometry, mode, number, x - h, y, z)
    gy = _bound(geometry, mode, number, x, y + h, z) - _bound(geometry, mode, number, x, y - h, z)
    gz = _bound(geometry, mode, number, x, y, z + h) - _bound(geometry, mode, number, x, y, z - h)
    return 0.5 * gx / h, 0.5 * gy / h, 0.5 * gz / h


@inner
def _rim_point(geometry, mode, part, bound, start, width):  # type: ignore[no-untyped-def]
    """(found, pose, direction along the rim) where the locus meets a bound of the workspace, near ``start``.

    Inside the bound of a leg the determinant goes with the root of the margin, so that the locus meets it
    at a tangent; just outside, where the root is clamped, it is smooth: that is where it is followed.
    """
    x, y, z = start
    h = RIM_DIFFERENCE * width
    for _ in range(RIM_STEPS):
        for _ in range(3):
            nx, ny, nz = _bound_gradient(geometry, mode, bound, x, y, z, h)
            square = nx * nx + ny * ny + nz * nz
            if not square > 0.0:
                return False, start, start
            excess = _bound(geometry, mode, bound, x, y, z) + 0.5 * REACH_TOLERANCE
            share = excess / square
            x, y, z = x - share * nx, y - share * ny, z - share * nz
        size = math.sqrt(square)
        n = (nx / size, ny / size, nz / size)
        a = perpendicular(n)
        b = (n[1] * a[2] - n[2] * a[1], n[2] * a[0] - n[0] * a[2], n[0] * a[1] - n[1] * a[0])
        value = determinant_at(geometry, mode, part, x, y, z)
        ga = _along(geometry, mode, part, (x, y, z), a, h) - _along(geometry, mode, part, (x, y, z), a, -h)
        gb = _along(geometry, mode, part, (x, y, z), b, h) - _along(geometry, mode, part, (x, y, z), b, -h)
        ga, gb = 0.5 * ga / h, 0.5 * gb / h
        slope = math.sqrt(ga * ga + gb * gb)
        if not slope > 0.0:
            return False, start, start
        way = -value / slope
        if abs(way) <= 1e-13 * width + 1e-15:
            u, v = -gb / slope, ga / slope
            rim = (u * a[0] + v * b[0], u * a[1] + v * b[1], u * a[2] + v * b[2])
            return abs(value) <= 1e-10, (x, y, z), rim
        u, v = way * ga / slope, way * gb / slope
        x, y, z = x + u * a[0] + v * b[0], y + u * a[1] + v * b[1], z + u * a[2] + v * b[2]
        if (x - start[0]) ** 2 + (y - start[1]) ** 2 + (z - start[2]) ** 2 > 4.0 * width * width:
            return False, start, start
    return False, start, start


@inner
def _slide_on_rim(geometry, mode, region, part, start, best, step, smallest):  # type: ignore[no-untyped-def]
    """Least signed distance along the rim of the locus, from one of its poses near a bound of reach."""
    bound, _ = _nearest_bound(geometry, mode, start[0], start[1], start[2])
    x, y, z = start
    found, pose, rim = _rim_point(geometry, mode, part, bound, start, step)
    if not found or workspace_margin(geometry, mode, pose[0], pose[1], pose[2]) < -REACH_TOLERANCE:
        return best, x, y, z
    here = signed_distance(region, pose[0], pose[1], pose[2])
    for _ in range(SLIDES):
        if step <= smallest:
            break
        u = nearest(region, pose[0], pose[1], pose[2])
        foot = (u[0] - pose[0]) * rim[0] + (u[1] - pose[1]) * rim[1] + (u[2] - pose[2]) * rim[2]
        moved = False
        for trial in range(3):
            way = foot if trial == 0 else (step if trial == 1 else -step)
            if abs(way) <= smallest:
                continue
            point = (pose[0] + way * rim[0], pose[1] + way * rim[1], pose[2] + way * rim[2])
            found, there, along = _rim_point(geometry, mode, part, bound, point, max(abs(way), step))
            if found and workspace_margin(geometry, mode, there[0], there[1], there[2]) >= -REACH_TOLERANCE:
                distance = signed_distance(region, there[0], there[1], there[2])
                if distance < here:
                    moved = distance < here - 1e-4 * step
                    here, pose, rim = distance, there, along
                    break
        if not moved:
            step *= 0.35
    if here < best:
        return here, pose[0], pose[1], pose[2]
    return best, x, y, z


@inner
def _best_slide(geometry, mode, region, part, starts, distances, stride, step, smallest):  # type: ignore[no-untyped-def]
    """Slide from the nearest starts that lie apart; ``stride`` skips starts."""
    best, bx, by, bz = math.inf, math.nan, math.nan, math.nan
    chosen = np.full(TRIES, -1, np.int64)
    # a start that does not get onto the locus bars only what is next to it
    failed = np.zeros(TRIES, np.bool_)
    arrived = 0
    for k in range(TRIES):
        pick = -1
        for n in range(0, distances.size, stride):
            if not distances[n] < math.inf or (pick >= 0 and distances[n] >= distances[pick]):
                continue
            apart = True
            # the farther, the wider: pieces in other directions are worth more than more of the same
            separation = max(2.0 * step, APART * distances[n])
            for j in range(k):
                m = chosen[j]
                square = 0.0
                for axis in range(3):
                    square += (starts[n, axis] - starts[m, axis]) ** 2
                least = 2.0 * step if failed[j] else separation
                apart = apart and square > least * least
            if apart:
                pick = n
        if pick < 0 or arrived == CANDIDATES:
            break
        chosen[k] = pick
        start = (starts[pick, 0], starts[pick, 1], starts[pick, 2])
        found = _slide(geometry, mode, region, part, start, step, smallest)
        if found[0] < math.inf:
            start = (found[1], found[2], found[3])
        # also from a start that leaves the workspace on its way to the locus
        if _nearest_bound(geometry, mode, start[0], start[1], start[2])[1] < RIM_REACH * step:
            found = _slide_on_rim(geometry, mode, region, part, start, found[0], step, smallest)
        failed[k] = not found[0] < math.inf
        arrived += not failed[k]
        if found[0] < best:
            best, bx, by, bz = found
    return best, bx, by, bz


@inner
def _signed_distances(region, points):  # type: ignore[no-untyped-def]
    out = np.empty(points.shape[0])
    for n in range(points.shape[0]):
        out[n] = signed_distance(region, points[n, 0], points[n, 1], points[n, 2])
    return out


@inner
def _lattice_crossings(values, grid):  # type: ignore[no-untyped-def]
    """Poses (N, 3) between lattice neighbours of opposite sign, by linear interpolation."""
    shape = values.shape
    found, count = np.empty((3 * values.size, 3)), 0
    for axis in range(3):
        di, dj, dk = int(axis == 0), int(axis == 1), int(axis == 2)
        for i in range(shape[0] - di):
            for j in range(shape[1] - dj):
                for k in range(shape[2] - dk):
                    a, b = values[i, j, k], values[i + di, j + dj, k + dk]
                    if (a > 0.0) != (b > 0.0):
                        share = a / (a - b)
                        for c in range(3):
                            p, q = grid[i, j, k, c], grid[i + di, j + dj, k + dk, c]
                            found[count, c] = p + share * (q - p)
                        count += 1
    return found[:count]


@inner
def _starts(inside, feeler_points, feeler_normals, ways, known):  # type: ignore[no-untyped-def]
    """Poses (N, 3) near the locus: on the lattice, along feelers, known from elsewhere."""
    starts = np.empty((inside.shape[0] + ways.size + known.shape[0], 3))
    count = 0
    for n in range(inside.shape[0]):
        for c in range(3):
            starts[count, c] = inside[n, c]
        count += 1
    for n in range(ways.size):
        if ways[n] < math.inf:
            for c in range(3):
                starts[count, c] = feeler_points[n, c] + ways[n] * feeler_normals[n, c]
            count += 1
    for n in range(known.shape[0]):
        for c in range(3):
            starts[count, c] = known[n, c]
        count += 1
    return starts[:count]


@kernel
def _nearest_locus(  # type: ignore[no-untyped-def]
    geometry, mode, region, part, determinants, grid, feeler_points, feeler_normals, seen, spacing, limit
):
    """As ``locus_distance``: least distance and its pose (2, 4) from all starts and from half of them."""
    inside = _lattice_crossings(determinants[part], grid)
    known = crossings(geometry, mode, part, seen)
    if known.shape[0] > 0:
        # what lies beyond a known point of the locus is not the nearest
        nearest_known = math.inf
        for distance in _signed_distances(region, known):
            nearest_known = min(nearest_known, distance)
        limit = min(limit, max(0.0, nearest_known) + spacing)
    count = determinants.shape[0]
    ways = _march(geometry, mode, count, part, feeler_points, feeler_normals, 0.5 * spacing, limit)
    starts = _starts(inside, feeler_points, feeler_normals, ways, known)
    distances = _signed_distances(region, starts)
    found = np.empty((2, 4))
    # a loop, since for each literal stride everything would be compiled by itself
    for k in range(2):
        best, x, y, z = _best_slide(
            geometry,
            mode,
            region,
            part,
            starts,
            distances,
            k + 1,
            0.5 * spacing,
            FINEST_STEP * spacing,
        )
        found[k, 0], found[k, 1], found[k, 2], found[k, 3] = best, x, y, z
    return found


def locus_distance(
    geometry: object,
    signs: object,
    region: PlacedRegion,
    part: int,
    *,
    determinants: NDArray[np.float64],
    grid: NDArray[np.float64],
    feeler_points: NDArray[np.float64],
    feeler_normals: NDArray[np.float64],
    seen: Survey,
    spacing: float,
    limit: float,
) -> LocusDistance:
    """Distance to the locus of one determinant, for a region that is reachable throughout.

    ``grid`` (I, J, K, 3): the region's lattice; ``determinants`` (D, I, J, K) on it; feelers as of
    ``sampling.feelers``; ``seen``: of the whole mode; ``spacing`` (m) of the lattice; ``limit`` (m) at which
    feelers end at the latest.
    """
    fine, coarse = _nearest_locus(
        geometry,
        signs,
        region,
        part,
        determinants,
        grid,
        feeler_points,
        feeler_normals,
        (seen.poses, seen.pairs, seen.determinants),
        spacing,
        limit,
    ).tolist()
    best = min(fine, coarse)
    if not best[0] < math.inf:
        return LocusDistance(math.inf, 0.0, None)
    both = max(fine[0], coarse[0]) < math.inf
    missed = abs(fine[0] - coarse[0]) if both else abs(best[0])
    return LocusDistance(best[0], missed + ERROR_FLOOR * spacing, (best[1], best[2], best[3]))
