"""Kernel of detection: cell list with a skin, in as many dimensions as the scene has; ranks along wires where there are wires."""

from __future__ import annotations

__all__ = ["DETECTION"]

DETECTION = '''
@njit
def find(x, radius, fixed$chains, skin, offsets, out):
    """Write pairs (i < j, sorted) with gap below the skin to `out`; returns how many there are, which may be more than fit."""
    count = x.shape[0]
    low = np.empty($dimension)
    cells = np.empty($dimension, dtype=np.int64)
    span = np.empty($dimension)
    # plain loops throughout: the reductions and sorts of the library compile for seconds
    largest = 0.0
    for i in range(count):
        largest = max(largest, radius[i])
    size = 2.0 * largest + skin
    total = 1
    for a in range($dimension):
        low[a] = x[0, a]
        high = x[0, a]
        for i in range(count):
            low[a] = min(low[a], x[i, a])
            high = max(high, x[i, a])
        # no more cells along one axis than bodies: a lone far body must not exhaust the memory
        cells[a] = int(min((high - low[a]) / size, float(count))) + 1
        span[a] = max(size, (high - low[a]) / cells[a] * (1.0 + 1e-12))
        total *= cells[a]
    while total > 8 * count + 64:
        most = 0
        for a in range($dimension):
            if cells[a] > cells[most]:
                most = a
        cells[most] = (cells[most] + 1) // 2
        span[most] = max(span[most] * 2.0, size)
        total = 1
        for a in range($dimension):
            total *= cells[a]
    head = np.empty(total, dtype=np.int64)
    for c in range(total):
        head[c] = -1
    following = np.empty(count, dtype=np.int64)
    place = np.empty((count, $dimension), dtype=np.int64)
    for i in range(count - 1, -1, -1):
        c = 0
        for a in range($dimension):
            place[i, a] = min(int((x[i, a] - low[a]) / span[a]), cells[a] - 1)
            c = c * cells[a] + place[i, a]
        following[i] = head[c]
        head[c] = i
    found = 0
    near = np.empty(count, dtype=np.int64)
    for i in range(count):
        near_count = 0
        for o in range(offsets.shape[0]):
            c_@ = place[i, @] + offsets[o, @]
            if min($components) < 0:
                continue
            c = 0
            outside = False
            outside = outside or c_@ >= cells[@]
            if outside:
                continue
            c = c * cells[@] + c_@
            j = head[c]
            while j >= 0:
                if j > i:
                    reach = radius[i] + radius[j] + skin
                    d_@ = x[i, @] - x[j, @]
                    if SUM(d_@ * d_@) < reach * reach and not (fixed[i] and fixed[j]):
                        if wire[i] >= 0 and wire[i] == wire[j] and abs(rank[i] - rank[j]) < apart:  #? wires
                            j = following[j]  #? wires
                            continue  #? wires
                        near[near_count] = j
                        near_count += 1
                j = following[j]
        for k in range(1, near_count):
            j = near[k]
            o = k - 1
            while o >= 0 and near[o] > j:
                near[o + 1] = near[o]
                o -= 1
            near[o + 1] = j
        for k in range(near_count):
            if found < out.shape[0]:
                out[found, 0] = i
                out[found, 1] = near[k]
            found += 1
    return found


@njit
def find_near_planes(x, radius, fixed, normal, place, skin, out):
    """Write (body, plane) with gap below the skin to `out`, plane by plane; returns how many there are."""
    found = 0
    for b in range(normal.shape[0]):
        for i in range(x.shape[0]):
            if not fixed[i] and SUM(normal[b, @] * x[i, @]) - place[b] - radius[i] < skin:
                if found < out.shape[0]:
                    out[found, 0] = i
                    out[found, 1] = b
                found += 1
    return found
'''
