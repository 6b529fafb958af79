"""Kernel of detection: cell list with a skin, in as many dimensions as the scene has."""

from __future__ import annotations

__all__ = ["DETECTION"]

DETECTION = '''
@njit
def find(x, radius, fixed, wire, rank, apart, skin, offsets, out):
    """Write pairs (i < j, sorted) with gap below the skin to `out`; returns how many there are, which may be more than fit."""
    count = x.shape[0]
    low = np.empty($dimension)
    cells = np.empty($dimension, dtype=np.int64)
    span = np.empty($dimension)
    size = 2.0 * radius.max() + skin
    for a in range($dimension):
        low[a] = x[:, a].min()
        # no more cells along one axis than bodies: a lone far body must not exhaust the memory
        cells[a] = int(min((x[:, a].max() - low[a]) / size, float(count))) + 1
        span[a] = max(size, (x[:, a].max() - low[a]) / cells[a] * (1.0 + 1e-12))
    while np.prod(cells) > 8 * count + 64:
        a = int(np.argmax(cells))
        cells[a] = (cells[a] + 1) // 2
        span[a] = max(span[a] * 2.0, size)
    head = np.full(np.prod(cells), -1, dtype=np.int64)
    following = np.full(count, -1, dtype=np.int64)
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
                        tied = wire[i] >= 0 and wire[i] == wire[j] and abs(rank[i] - rank[j]) < apart
                        if not tied:
                            near[near_count] = j
                            near_count += 1
                j = following[j]
        near[:near_count].sort()
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
