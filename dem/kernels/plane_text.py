r"""Kernels of contacts between a round body and a plane: n the plane's normal, into the sample, g = n·x − place − r.

A plane moves along its normal with one degree of freedom w (n·V = sense w; the planes of a box share one a pair) and may slide in itself
with a given velocity. W_n = 1/m + 1/M, where 1/M is the inverse mass of the degree of freedom, 0 for one that is fixed or driven, or the
mobility of a servo per step. W_t is the body's alone.
"""

from __future__ import annotations

__all__ = ["PLANES"]

PLANES = '''
@njit
def collect(x, radii, before, beads, normal, place, sense, dof, slide, grip, motion, walls, warm, parameter, reach, step,
            wall, row, cold, candidate$scalars):
    """Write the rows of the candidates that touch; returns how many. Impulses start from those of the step before."""
    $unpack
    m = 0
    for k in range(walls.shape[0]):
        i = walls[k, 0]
        b = walls[k, 1]
        n_@ = normal[b, @]
        gap = SUM(n_@ * x[i, @]) - place[b] - radii[i]
        if not ($touching):
            warm[k, :] = 0.0
            continue
        w = before[i, $w] + motion[dof[b], 1]
        v_@ = before[i, @] - slide[b, @]  #? approach or slip
        s_^ = before[i, $s + ^]  #? slip and spin
        v_0 -= s_1 * n_2 - s_2 * n_1  #? slip and spin and three
        v_1 -= s_2 * n_0 - s_0 * n_2  #? slip and spin and three
        v_2 -= s_0 * n_1 - s_1 * n_0  #? slip and spin and three
        v_0 += s_0 * n_1  #? slip and spin and two
        v_1 -= s_0 * n_0  #? slip and spin and two
        normal_part = SUM(v_@ * n_@)  #? approach or slip
        approach = normal_part - sense[b] * motion[dof[b], 0]  #? approach or slip
        slip = np.sqrt(max(0.0, SUM(v_@ * v_@) - normal_part * normal_part))  #? slip
        bead = beads[i]  #? bead
        radius = radii[i]  #? radius
        mass = 1.0 / w  #? mass
        impulse = warm[k, $warm_n]
        t_@ = warm[k, @]  #? friction
        size = np.sqrt(SUM(t_@ * t_@))  #? friction
        out = SUM(t_@ * n_@)  #? friction
        t_@ = t_@ - out * n_@  #? friction
        kept = np.sqrt(SUM(t_@ * t_@))  #? friction
        if kept > 0.0:  #? friction
            t_@ = t_@ * size / kept  #? friction
        mu = grip[b]  #? mu_column
        if mu == 0.0:  #? mu_column
            t_@ = 0.0  #? mu_column
        cn = $normal_compliance  #? cn_column
        ct = $tangential_compliance  #? ct_column
        wall[m, 0] = i
        wall[m, 1] = b
        candidate[m] = k
        row[m, $p + @] = impulse * n_@ + t_@  #? friction
        row[m, $p] = impulse  #? not friction
        row[m, $e + @] = t_@  #? ct
        row[m, $b] = $bias
        row[m, $iw] = 1.0 / (w + cn)  #? cn
        row[m, $iw] = 1.0 / w  #? not cn
        row[m, $it] = 1.0 / ($turning * before[i, $w] + ct)  #? ct and not mixed
        row[m, $it] = 1.0 / ($turning * before[i, $w])  #? friction and not ct and not mixed
        row[m, $it] = 1.0 / (before[i, $w] + before[i, $r] + ct)  #? ct and mixed
        row[m, $it] = 1.0 / (before[i, $w] + before[i, $r])  #? mixed and not ct
        row[m, $mu_at] = mu  #? mu_column
        row[m, $cn_at] = cn  #? cn_column
        row[m, $ct_at] = ct  #? ct_column
        row[m, $least_at] = $least_value  #? least_column
        cold[m, 0] = gap
        cold[m, 1] = impulse  #? cn
        m += 1
    return m


@njit
def keep(row, wall, normal, candidate, warm):
    """Write the solved impulses back to the candidates they came from."""
    for m in range(candidate.shape[0]):
        k = candidate[m]
        warm[k, $warm_n] = row[m, $p]  #? not friction
        n_@ = normal[wall[m, 1], @]  #? friction
        pn = SUM(n_@ * row[m, $p + @])  #? friction
        warm[k, @] = row[m, $p + @] - pn * n_@  #? friction
        warm[k, $warm_n] = pn  #? friction


@njit
def apply(vel, motion, wall, row, normal, sense, dof):
    """Add the impulses of the rows to bodies and planes (warm start)."""
    for k in range(wall.shape[0]):
        i = wall[k, 0]
        b = wall[k, 1]
        q = dof[b]
        n_@ = normal[b, @]
        d_@ = row[k, $p + @]  #? friction
        dn = SUM(d_@ * n_@)  #? friction
        dn = row[k, $p]  #? not friction
        d_@ = dn * n_@  #? not friction
        mi = vel[i, $w]
        vel[i, @] += mi * d_@
        motion[q, 0] -= sense[b] * dn * motion[q, 1]
        c_0 = $lever (n_1 * d_2 - n_2 * d_1)  #? spin and three
        c_1 = $lever (n_2 * d_0 - n_0 * d_2)  #? spin and three
        c_2 = $lever (n_0 * d_1 - n_1 * d_0)  #? spin and three
        c_0 = $lever (n_0 * d_1 - n_1 * d_0)  #? spin and two
        mi = vel[i, $r]  #? mixed
        vel[i, $s + ^] -= mi * c_^  #? spin


@njit
def sweep(vel, motion, wall, row, normal, sense, dof, slide$scalars):
    """One Gauss–Seidel sweep over the contacts with planes; returns Σ|δp|² and Σp_n²."""
    change = 0.0
    size = 0.0
    for k in range(wall.shape[0]):
        i = wall[k, 0]
        b = wall[k, 1]
        q = dof[b]
        n_@ = normal[b, @]
        u_@ = vel[i, @] - slide[b, @]  #? friction
        s_^ = vel[i, $s + ^]  #? spin
        u_0 -= s_1 * n_2 - s_2 * n_1  #? spin and three
        u_1 -= s_2 * n_0 - s_0 * n_2  #? spin and three
        u_2 -= s_0 * n_1 - s_1 * n_0  #? spin and three
        u_0 += s_0 * n_1  #? spin and two
        u_1 -= s_0 * n_0  #? spin and two
        across = SUM(u_@ * n_@)  #? friction
        un = across - sense[b] * motion[q, 0]  #? friction
        un = SUM(vel[i, @] * n_@) - sense[b] * motion[q, 0]  #? not friction
        p_@ = row[k, $p + @]  #? friction
        pn = SUM(p_@ * n_@)  #? friction
        pn = row[k, $p]  #? not friction
        new = pn - (un + row[k, $b] + $cn * pn) * row[k, $iw]  #? cn
        new = pn - (un + row[k, $b]) * row[k, $iw]  #? not cn
        new = max($least, new)
        size += new * new
        dn = new - pn
        if dn == 0.0:  #? not friction
            continue  #? not friction
        change += dn * dn  #? not friction
        row[k, $p] = new  #? not friction
        d_@ = dn * n_@  #? not friction
        q_@ = p_@ - pn * n_@  #? friction
        it = row[k, $it]  #? friction
        q_@ -= (u_@ - across * n_@ + $ct * (q_@ - row[k, $e + @])) * it  #? ct
        q_@ -= (u_@ - across * n_@) * it  #? friction and not ct
        bound = $mu * (new - $least)  #? friction
        length = SUM(q_@ * q_@)  #? friction
        if length > bound * bound:  #? friction
            cut = bound / np.sqrt(length)  #? friction
            q_@ *= cut  #? friction
        q_@ += new * n_@  #? friction
        d_@ = q_@ - p_@  #? friction
        change += SUM(d_@ * d_@)  #? friction
        row[k, $p + @] = q_@  #? friction
        mi = vel[i, $w]
        vel[i, @] += mi * d_@
        motion[q, 0] -= sense[b] * dn * motion[q, 1]
        c_0 = $lever (n_1 * d_2 - n_2 * d_1)  #? spin and three
        c_1 = $lever (n_2 * d_0 - n_0 * d_2)  #? spin and three
        c_2 = $lever (n_0 * d_1 - n_1 * d_0)  #? spin and three
        c_0 = $lever (n_0 * d_1 - n_1 * d_0)  #? spin and two
        mi = vel[i, $r]  #? mixed
        vel[i, $s + ^] -= mi * c_^  #? spin
    return change, size


@njit
def measure(before, after, motion_before, motion, driven, wall, row, cold, normal, sense, dof, slide, step, theta, out$scalars):
    """Add residual, overlap and energy of the rows to `out`, from velocities that were rebuilt from the impulses."""
    for k in range(wall.shape[0]):
        i = wall[k, 0]
        b = wall[k, 1]
        q = dof[b]
        n_@ = normal[b, @]
        speed = sense[b] * motion[q, 0]
        speed_before = sense[b] * motion_before[q, 0]
        u_@ = after[i, @] - slide[b, @] - speed * n_@  #? friction
        u_@ = after[i, @] - speed * n_@  #? not friction
        o_@ = before[i, @] - slide[b, @] - speed_before * n_@  #? friction
        o_@ = before[i, @] - speed_before * n_@  #? not friction
        s_^ = after[i, $s + ^]  #? spin
        u_0 -= s_1 * n_2 - s_2 * n_1  #? spin and three
        u_1 -= s_2 * n_0 - s_0 * n_2  #? spin and three
        u_2 -= s_0 * n_1 - s_1 * n_0  #? spin and three
        u_0 += s_0 * n_1  #? spin and two
        u_1 -= s_0 * n_0  #? spin and two
        s_^ = before[i, $s + ^]  #? spin
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
        free = $least
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
            out[$shock] += pn * row[k, $b]  #? not cn
        if driven[q]:
            out[$drive] += pn * (theta * speed + (1.0 - theta) * speed_before)
        out[$drive] += SUM(p_@ * slide[b, @])  #? friction
        if pn > 0.0:
            out[$closed] += 1.0
            out[$force] += pn
            end = -(gap + step * un)
            out[$overlap] += max(0.0, end)
            out[$overlap_max] = max(out[$overlap_max], end)
            if mu > 0.0 and np.sqrt(tangent) > mu * (pn - free) * (1.0 - 1e-6):  #? friction
                out[$sliding] += 1.0  #? friction
'''
