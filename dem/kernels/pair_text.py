r"""Kernels of contacts between two round bodies i < j: n from j to i, g = |x_i − x_j| − r_i − r_j at the detection configuration.

For one contact with the others held, u = ū + W p with W diagonal for round bodies: W_n = 1/m_i + 1/m_j on the normal and W_t = W_n + r²/I
of those that rotate (7/2 W_n for solid spheres, 3 W_n for disks). The local problem has a closed solution,

    p_n = max(p_0, p_n − (u_n + b + c_n p_n)/(W_n + c_n)),
    p_t = radial cut to μ (p_n − p_0) of  p_t − (u_t + c_t (p_t − p_t⁰))/(W_t + c_t).

Velocities stand per body and are updated at once; no Delassus matrix is stored. Jean (1999), CMAME 177, 235–257;
Radjai and Richefeu (2009).
"""

from __future__ import annotations

__all__ = ["PAIRS", "PAIRS_THREADED"]

PAIRS = '''
@njit
def collect(x, radii, before, beads, pairs, warm, parameter, reach, step, pair, row, cold, candidate$scalars):
    """Write the rows of the candidates that touch; returns how many. Impulses start from those of the step before."""
    $unpack
    m = 0
    for k in range(pairs.shape[0]):
        i = pairs[k, 0]
        j = pairs[k, 1]
        d_@ = x[i, @] - x[j, @]
        distance = np.sqrt(SUM(d_@ * d_@))
        gap = distance - radii[i] - radii[j]
        if not ($touching):
            warm[k, :] = 0.0
            continue
        if distance > 0.0:
            n_@ = d_@ / distance
        else:
            n_@ = 0.0
            n_$last = 1.0
        w = before[i, $w] + before[j, $w]
        v_@ = before[i, @] - before[j, @]  #? approach or slip
        s_^ = before[i, $s + ^] + before[j, $s + ^]  #? slip and spin
        v_0 -= s_1 * n_2 - s_2 * n_1  #? slip and spin and three
        v_1 -= s_2 * n_0 - s_0 * n_2  #? slip and spin and three
        v_2 -= s_0 * n_1 - s_1 * n_0  #? slip and spin and three
        v_0 += s_0 * n_1  #? slip and spin and two
        v_1 -= s_0 * n_0  #? slip and spin and two
        approach = SUM(v_@ * n_@)  #? approach or slip
        slip = np.sqrt(max(0.0, SUM(v_@ * v_@) - approach * approach))  #? slip
        bead = beads[i] or beads[j]  #? bead
        radius = radii[i] * radii[j] / (radii[i] + radii[j])  #? radius
        mass = 1.0 / w  #? mass
        impulse = warm[k, $warm_n]
        # the tangential part turns with the tangent plane and keeps its size, the normal part is the old pressure: a pair that
        # turns as a whole carries its forces along
        t_@ = warm[k, @]  #? friction
        size = np.sqrt(SUM(t_@ * t_@))  #? friction
        out = SUM(t_@ * n_@)  #? friction
        t_@ = t_@ - out * n_@  #? friction
        kept = np.sqrt(SUM(t_@ * t_@))  #? friction
        if kept > 0.0:  #? friction
            t_@ = t_@ * size / kept  #? friction
        mu = $friction  #? mu_column
        if mu == 0.0:  #? mu_column
            t_@ = 0.0  #? mu_column
        cn = $normal_compliance  #? cn_column
        ct = $tangential_compliance  #? ct_column
        pair[m, 0] = i
        pair[m, 1] = j
        candidate[m] = k
        row[m, $n + @] = n_@
        row[m, $p + @] = impulse * n_@ + t_@  #? friction
        row[m, $p] = impulse  #? not friction
        row[m, $e + @] = t_@  #? ct
        row[m, $b] = $bias
        row[m, $iw] = 1.0 / (w + cn)  #? cn
        row[m, $iw] = 1.0 / w  #? not cn
        row[m, $it] = 1.0 / ($turning * w + ct)  #? ct and not mixed
        row[m, $it] = 1.0 / (w + before[i, $r] + before[j, $r] + ct)  #? ct and mixed
        row[m, $it] = 1.0 / (w + before[i, $r] + before[j, $r])  #? mixed and not ct
        row[m, $mu_at] = mu  #? mu_column
        row[m, $cn_at] = cn  #? cn_column
        row[m, $ct_at] = ct  #? ct_column
        row[m, $least_at] = $least_value  #? least_column
        cold[m, 0] = gap
        cold[m, 1] = impulse  #? cn
        m += 1
    return m


@njit
def keep(row, candidate, warm):
    """Write the solved impulses back to the candidates they came from."""
    for m in range(candidate.shape[0]):
        k = candidate[m]
        warm[k, $warm_n] = row[m, $p]  #? not friction
        pn = SUM(row[m, $n + @] * row[m, $p + @])  #? friction
        warm[k, @] = row[m, $p + @] - pn * row[m, $n + @]  #? friction
        warm[k, $warm_n] = pn  #? friction


@njit
def apply(vel, pair, row):
    """Add the impulses of the rows to the velocities of the bodies (warm start)."""
    for k in range(pair.shape[0]):
        i = pair[k, 0]
        j = pair[k, 1]
        n_@ = row[k, $n + @]
        d_@ = row[k, $p + @]  #? friction
        d_@ = row[k, $p] * n_@  #? not friction
        mi = vel[i, $w]
        mj = vel[j, $w]
        vel[i, @] += mi * d_@
        vel[j, @] -= mj * d_@
        c_0 = $lever (n_1 * d_2 - n_2 * d_1)  #? spin and three
        c_1 = $lever (n_2 * d_0 - n_0 * d_2)  #? spin and three
        c_2 = $lever (n_0 * d_1 - n_1 * d_0)  #? spin and three
        c_0 = $lever (n_0 * d_1 - n_1 * d_0)  #? spin and two
        mi = vel[i, $r]  #? mixed
        mj = vel[j, $r]  #? mixed
        vel[i, $s + ^] -= mi * c_^  #? spin
        vel[j, $s + ^] -= mj * c_^  #? spin


@njit
def sweep(vel, pair, row, first, last$scalars):
    """One Gauss–Seidel sweep over the rows [first, last); returns Σ|δp|² and Σp_n²."""
    change = 0.0
    size = 0.0
    for k in range(first, last):
        i = pair[k, 0]
        j = pair[k, 1]
        n_@ = row[k, $n + @]
        u_@ = vel[i, @] - vel[j, @]
        s_^ = vel[i, $s + ^] + vel[j, $s + ^]  #? spin
        u_0 -= s_1 * n_2 - s_2 * n_1  #? spin and three
        u_1 -= s_2 * n_0 - s_0 * n_2  #? spin and three
        u_2 -= s_0 * n_1 - s_1 * n_0  #? spin and three
        u_0 += s_0 * n_1  #? spin and two
        u_1 -= s_0 * n_0  #? spin and two
        un = SUM(u_@ * n_@)
        p_@ = row[k, $p + @]  #? friction
        pn = SUM(p_@ * n_@)  #? friction
        pn = row[k, $p]  #? not friction
        new = pn - (un + row[k, $b] + $cn * pn) * row[k, $iw]  #? cn
        new = pn - (un + row[k, $b]) * row[k, $iw]  #? not cn
        new = max($least, new)  #? not friction
        size += new * new  #? not friction
        d = new - pn  #? not friction
        if d == 0.0:  #? not friction
            continue  #? not friction
        change += d * d  #? not friction
        row[k, $p] = new  #? not friction
        d_@ = d * n_@  #? not friction
        if new <= $least:  #? friction
            if pn == $least:  #? friction
                size += pn * pn  #? friction and least
                continue  #? friction
            q_@ = $least * n_@  #? friction
            size += $least * $least  #? friction and least
        else:  #? friction
            q_@ = p_@ - pn * n_@  #? friction
            it = row[k, $it]  #? ct or mixed
            it = row[k, $iw] * $turned  #? friction and not ct and not mixed and spin
            it = row[k, $iw]  #? friction and not ct and not spin
            q_@ -= (u_@ - un * n_@ + $ct * (q_@ - row[k, $e + @])) * it  #? ct
            q_@ -= (u_@ - un * n_@) * it  #? friction and not ct
            bound = $mu * new  #? friction and not least
            bound = $mu * (new - $least)  #? friction and least
            length = SUM(q_@ * q_@)  #? friction
            if length > bound * bound:  #? friction
                cut = bound / np.sqrt(length)  #? friction
                q_@ *= cut  #? friction
            q_@ += new * n_@  #? friction
            size += new * new  #? friction
        d_@ = q_@ - p_@  #? friction
        change += SUM(d_@ * d_@)  #? friction
        row[k, $p + @] = q_@  #? friction
        mi = vel[i, $w]
        mj = vel[j, $w]
        vel[i, @] += mi * d_@
        vel[j, @] -= mj * d_@
        # torque about both centres is −r n × d
        c_0 = $lever (n_1 * d_2 - n_2 * d_1)  #? spin and three
        c_1 = $lever (n_2 * d_0 - n_0 * d_2)  #? spin and three
        c_2 = $lever (n_0 * d_1 - n_1 * d_0)  #? spin and three
        c_0 = $lever (n_0 * d_1 - n_1 * d_0)  #? spin and two
        mi = vel[i, $r]  #? mixed
        mj = vel[j, $r]  #? mixed
        vel[i, $s + ^] -= mi * c_^  #? spin
        vel[j, $s + ^] -= mj * c_^  #? spin
    return change, size


@njit
def measure(before, after, pair, row, cold, step, theta, out$scalars):
    """Add residual, overlap and energy of the rows to `out`, from velocities that were rebuilt from the impulses."""
    for k in range(pair.shape[0]):
        i = pair[k, 0]
        j = pair[k, 1]
        n_@ = row[k, $n + @]
        u_@ = after[i, @] - after[j, @]
        o_@ = before[i, @] - before[j, @]
        s_^ = after[i, $s + ^] + after[j, $s + ^]  #? spin
        u_0 -= s_1 * n_2 - s_2 * n_1  #? spin and three
        u_1 -= s_2 * n_0 - s_0 * n_2  #? spin and three
        u_2 -= s_0 * n_1 - s_1 * n_0  #? spin and three
        u_0 += s_0 * n_1  #? spin and two
        u_1 -= s_0 * n_0  #? spin and two
        s_^ = before[i, $s + ^] + before[j, $s + ^]  #? spin
        o_0 -= s_1 * n_2 - s_2 * n_1  #? spin and three
        o_1 -= s_2 * n_0 - s_0 * n_2  #? spin and three
        o_2 -= s_0 * n_1 - s_1 * n_0  #? spin and three
        o_0 += s_0 * n_1  #? spin and two
        o_1 -= s_0 * n_0  #? spin and two
        un = SUM(u_@ * n_@)
        p_@ = row[k, $p + @]  #? friction
        pn = SUM(p_@ * n_@)  #? friction
        pn = row[k, $p]  #? not friction
        p_@ = pn * n_@  #? not friction
        gap = cold[k, 0]
        law = un + row[k, $b] + $cn * pn  #? cn
        law = un + row[k, $b]  #? not cn
        rho = row[k, $iw]
        free = $least  #? least
        free = 0.0  #? not least
        # normal map: p − P_K(p − ρ û) on the cone with its apex at p_0
        a_n = pn - free - rho * law
        c_n = max(0.0, a_n)  #? not friction
        error = (pn - free - c_n) ** 2  #? not friction
        size = pn * pn  #? not friction
        t_@ = p_@ - pn * n_@  #? friction
        l_@ = u_@ - un * n_@ + $ct * (t_@ - row[k, $e + @])  #? ct
        l_@ = u_@ - un * n_@  #? friction and not ct
        mu = $mu  #? friction
        if mu == 0.0:  #? friction
            l_@ = 0.0  #? friction
        slip = np.sqrt(SUM(l_@ * l_@))  #? friction
        a_n -= rho * mu * slip  #? friction
        a_@ = t_@ - rho * l_@  #? friction
        a_t = np.sqrt(SUM(a_@ * a_@))  #? friction
        if a_n >= 0.0 and a_t <= mu * a_n:  #? friction
            c_n = a_n  #? friction
            c_t = 1.0  #? friction
        elif mu * a_t <= -a_n:  #? friction
            c_n = 0.0  #? friction
            c_t = 0.0  #? friction
        else:  #? friction
            c_n = (a_n + mu * a_t) / (1.0 + mu * mu)  #? friction
            c_t = mu * c_n / a_t  #? friction
        x_@ = t_@ - c_t * a_@  #? friction
        error = (pn - free - c_n) ** 2 + SUM(x_@ * x_@)  #? friction
        tangent = SUM(t_@ * t_@)  #? friction
        size = pn * pn + tangent  #? friction
        out[$squared] += error
        out[$worst] = max(out[$worst], error)
        out[$size] += size
        out[$violation_max] = max(out[$violation_max], -gap - step * (un + $cn * pn))  #? cn
        out[$violation_max] = max(out[$violation_max], -gap - step * un)  #? not cn
        out[$work] += SUM(p_@ * (theta * u_@ + (1.0 - theta) * o_@))
        out[$shock] += (1.0 - theta) * SUM(p_@ * (u_@ - o_@))
        out[$elastic] += 0.5 * $cn * pn * pn  #? cn
        out[$elastic] += 0.5 * $ct * tangent  #? ct
        out[$friction_loss] -= SUM(t_@ * l_@)  #? friction
        out[$algorithmic] += 0.5 * $cn * (pn - cold[k, 1]) ** 2  #? cn
        x_@ = t_@ - row[k, $e + @]  #? ct
        out[$algorithmic] += 0.5 * $ct * SUM(x_@ * x_@)  #? ct
        if row[k, $b] > 0.0:
            # the force acts during the whole step in which the gap closes
            out[$algorithmic] += pn * row[k, $b]
        else:  #? not cn
            # an overlap pushed out, or a restitution, gives back  #? not cn
            out[$shock] += pn * row[k, $b]  #? not cn
        if pn > 0.0:
            out[$closed] += 1.0
            out[$force] += pn
            end = -(gap + step * un)
            out[$overlap] += max(0.0, end)
            out[$overlap_max] = max(out[$overlap_max], end)
            if mu > 0.0 and np.sqrt(tangent) > mu * (pn - free) * (1.0 - 1e-6):  #? friction
                out[$sliding] += 1.0  #? friction
'''

PAIRS_THREADED = '''
@njit(parallel=True)
def sweep_parts(vel, pair, row, starts, part$scalars):
    """The rows lie in parts that share no body, swept at the same time, then the rows that cross; the same bits on every run."""
    parts = starts.shape[0] - 2
    for b in prange(parts):
        change, size = sweep(vel, pair, row, starts[b], starts[b + 1]$scalars)
        part[b, 0] = change
        part[b, 1] = size
    total, whole = sweep(vel, pair, row, starts[parts], starts[parts + 1]$scalars)
    for b in range(parts):
        total += part[b, 0]
        whole += part[b, 1]
    return total, whole
'''
