r"""Kernels over bodies: velocities before the step and without impulses, energies, positions.

A row of velocities: v (as many as dimensions), r·ω where bodies turn (three, or one in the plane), 1/m, and r²/I where only some turn.
"""

from __future__ import annotations

__all__ = ["BODIES"]

BODIES = '''
@njit
def prepare(velocity, spin, inverse_mass, turning, gravity, step, before, free):
    """Fill the rows before the step, and those after gravity has acted on bodies that can move."""
    for i in range(velocity.shape[0]):
        w = inverse_mass[i]
        before[i, @] = velocity[i, @]
        before[i, $s + ^] = spin[i, ^]  #? spin
        before[i, $w] = w
        before[i, $r] = turning[i]  #? mixed
        for c in range(before.shape[1]):  # a copy of slices would compile ten times as long
            free[i, c] = before[i, c]
        if w > 0.0:
            free[i, @] += step * gravity[@]


@njit
def moved(x, listed):
    """Largest squared distance from the places at which the candidates were listed."""
    most = 0.0
    for i in range(x.shape[0]):
        d_@ = x[i, @] - listed[i, @]
        most = max(most, SUM(d_@ * d_@))
    return most


@njit
def fastest(free):
    """Largest speed of a body."""
    most = 0.0
    for i in range(free.shape[0]):
        most = max(most, SUM(free[i, @] * free[i, @]))
    return np.sqrt(most)


@njit
def measure(before, after, free, mass, theta, out):
    """Kinetic energy, work of the weight, damping of the scheme and net impulses, added to `out`."""
    for i in range(before.shape[0]):
        if before[i, $w] == 0.0:
            continue
        d_@ = after[i, @] - before[i, @]
        change = SUM(d_@ * d_@)
        out[$unbalanced] += mass[i] * np.sqrt(change)
        out[$kinetic] += 0.5 * mass[i] * SUM(after[i, @] * after[i, @])
        out[$weight] += mass[i] * SUM((free[i, @] - before[i, @]) * (theta * after[i, @] + (1.0 - theta) * before[i, @]))
        s_^ = after[i, $s + ^]  #? spin
        o_^ = s_^ - before[i, $s + ^]  #? spin
        inertia = $inertia * mass[i]  #? spin
        out[$kinetic] += 0.5 * inertia * s_^ * s_^  #? spin
        change += $inertia * o_^ * o_^  #? spin
        out[$damping] += (theta - 0.5) * mass[i] * change


@njit
def advance(x, after, velocity, spin, step):
    """Take over the velocities and move the bodies; returns whether all is finite."""
    total = 0.0
    for i in range(x.shape[0]):
        velocity[i, @] = after[i, @]
        spin[i, ^] = after[i, $s + ^]  #? spin
        x[i, @] += step * velocity[i, @]
        total += SUM(x[i, @])
    return np.isfinite(total)
'''
