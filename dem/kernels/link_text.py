r"""Kernels of links between two beads: tension impulse r on the row u_n + β − c r, of either sign or r ≥ 0; no tangential row."""

from __future__ import annotations

__all__ = ["LINKS"]

LINKS = '''
@njit
def collect(x, before, links, length, warm, parameter, step, row):
    """Write the rows of all links; tensions start from those of the step before."""
    $unpack
    for k in range(links.shape[0]):
        i = links[k, 0]
        j = links[k, 1]
        d_@ = x[i, @] - x[j, @]
        distance = np.sqrt(SUM(d_@ * d_@))
        n_@ = d_@ / distance
        natural = length[k]  #? natural
        approach = SUM((before[i, @] - before[j, @]) * n_@)  #? approach
        row[k, $n + @] = n_@
        row[k, $p] = warm[k]
        row[k, $b] = $bias  #? bias
        compliance = $compliance  #? compliant
        row[k, $c] = compliance  #? compliant
        row[k, $o] = warm[k]  #? compliant
        row[k, $iw] = 1.0 / (before[i, $w] + before[j, $w] + compliance)  #? compliant
        row[k, $iw] = 1.0 / (before[i, $w] + before[j, $w])  #? not compliant


@njit
def apply(vel, link, row):
    """Add the tensions of the rows to the velocities of the beads (warm start)."""
    for k in range(link.shape[0]):
        i = link[k, 0]
        j = link[k, 1]
        vel[i, @] -= row[k, $p] * row[k, $n + @] * vel[i, $w]
        vel[j, @] += row[k, $p] * row[k, $n + @] * vel[j, $w]


@njit
def sweep(vel, link, row):
    """One Gauss–Seidel sweep over the links; returns Σ|δr|² and Σr²."""
    change = 0.0
    size = 0.0
    for k in range(link.shape[0]):
        i = link[k, 0]
        j = link[k, 1]
        n_@ = row[k, $n + @]
        old = row[k, $p]
        un = SUM((vel[i, @] - vel[j, @]) * n_@)
        new = old + (un + row[k, $b] - row[k, $c] * old) * row[k, $iw]  #? bias and compliant
        new = old + (un + row[k, $b]) * row[k, $iw]  #? bias and not compliant
        new = old + (un - row[k, $c] * old) * row[k, $iw]  #? compliant and not bias
        new = old + un * row[k, $iw]  #? not compliant and not bias
        if new < 0.0:  #? unilateral
            new = 0.0  #? unilateral
        size += new * new
        d = new - old
        if d != 0.0:
            change += d * d
            row[k, $p] = new
            mi = vel[i, $w] * d
            mj = vel[j, $w] * d
            vel[i, @] -= mi * n_@
            vel[j, @] += mj * n_@
    return change, size


@njit
def measure(before, after, link, row, theta, out):
    """Add residual and energy of the links to `out`, from velocities that were rebuilt from the impulses."""
    for k in range(link.shape[0]):
        i = link[k, 0]
        j = link[k, 1]
        un = SUM((after[i, @] - after[j, @]) * row[k, $n + @])
        wn = SUM((before[i, @] - before[j, @]) * row[k, $n + @])
        r = row[k, $p]
        law = un
        law += row[k, $b]  #? bias
        law -= row[k, $c] * r  #? compliant
        trial = r + row[k, $iw] * law
        trial = max(0.0, trial)  #? unilateral
        error = (r - trial) ** 2
        out[$squared] += error
        out[$worst] = max(out[$worst], error)
        out[$size] += r * r
        out[$work] -= r * (theta * un + (1.0 - theta) * wn)
        out[$shock] -= (1.0 - theta) * r * (un - wn)
        out[$elastic] += 0.5 * row[k, $c] * r * r  #? compliant
        out[$wires] += 0.5 * row[k, $c] * (r - row[k, $o]) ** 2  #? compliant
        if row[k, $b] < 0.0:  #? bias and unilateral
            out[$wires] -= r * row[k, $b]  #? bias and unilateral
        else:  #? bias and unilateral and not compliant
            out[$shock] -= r * row[k, $b]  #? bias and unilateral and not compliant
        out[$shock] -= r * row[k, $b]  #? bias and not unilateral and not compliant
'''
