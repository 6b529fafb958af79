"""The parts of a generated module that are the same for every law: the loop over points, and the loop over steps.

They stand in the generated module, not beside it, so that numba binds them to the law's own `point_` and keeps them on disk.
"""

from __future__ import annotations

__all__ = ["BATCH", "DRIVE"]

BATCH = '''


@njit(folder=FOLDER)
def batch_(eps_, old_, new_, stress_, tangent_, want_, dissipation_, status_, values_):
    """The step at every point; arrays have the point index first."""
    c_ = constants_(values_)
    work_ = np.zeros((WORK_ROWS, 12))
    last_ = tangent_.shape[0] - 1
    for m_ in range(eps_.shape[0]):
        status_[m_], dissipation_[m_] = point_(
            eps_[m_], old_[m_], new_[m_], stress_[m_], tangent_[min(m_, last_)], want_, work_, c_
        )


@njit(folder=FOLDER)
def energies_(eps_, state_, psi_, values_):
    """Free energy at every point."""
    c_ = constants_(values_)
    work_ = np.zeros((WORK_ROWS, 12))
    for m_ in range(eps_.shape[0]):
        psi_[m_] = energy_(eps_[m_], state_[m_], work_, c_)
'''

DRIVE = '''

@njit(folder=FOLDER)
def solve_(matrix_, right_, size_, floor_):
    """Gaussian elimination with partial pivoting, in place; a pivot below `floor_` is replaced by it."""
    for k_ in range(size_):
        best_ = k_
        for i_ in range(k_ + 1, size_):
            if abs(matrix_[i_, k_]) > abs(matrix_[best_, k_]):
                best_ = i_
        if best_ != k_:
            for j_ in range(k_, size_):
                matrix_[k_, j_], matrix_[best_, j_] = matrix_[best_, j_], matrix_[k_, j_]
            right_[k_], right_[best_] = right_[best_], right_[k_]
        if abs(matrix_[k_, k_]) < floor_:
            matrix_[k_, k_] = floor_
        for i_ in range(k_ + 1, size_):
            factor_ = matrix_[i_, k_]/matrix_[k_, k_]
            if factor_ != 0.0:
                for j_ in range(k_, size_):
                    matrix_[i_, j_] -= factor_*matrix_[k_, j_]
                right_[i_] -= factor_*right_[k_]
    for k_ in range(size_ - 1, -1, -1):
        for j_ in range(k_ + 1, size_):
            right_[k_] -= matrix_[k_, j_]*right_[j_]
        right_[k_] /= matrix_[k_, k_]


@njit(folder=FOLDER)
def drive_(base_, goal_, z_, v_, symmetric_, eps_, old_, out_eps_, out_sig_, out_state_, out_psi_, out_dissipation_,
           values_, tolerance_, limit_):
    """Steps under mixed control: find y with v sigma(base + z y) = goal, by damped Newton; returns (failed row, residual, scale).

    The strain increment lies in the span of the columns of `z_`, the stress is tested by the rows of `v_`.
    """
    c_ = constants_(values_)
    work_ = np.zeros((WORK_ROWS, 12))
    steps_, size_ = base_.shape[0], z_.shape[1]
    new_ = np.zeros(out_state_.shape[1])
    sig_, tangent_ = np.zeros(6), np.zeros((6, 6))
    trial_, start_ = np.zeros(6), np.zeros(6)
    residual_, step_, matrix_ = np.zeros(6), np.zeros(6), np.zeros((6, 6))
    stiff_, total_, highest_, lost_ = 0.0, 0.0, 0.0, 0.0
    for n_ in range(steps_):
        # the prescribed part of the strain is put on at once; unknown components begin at their last value
        for i_ in range(6):
            trial_[i_] = base_[n_, i_]
        for k_ in range(size_):
            part_, along_ = 0.0, 0.0
            for i_ in range(6):
                part_ += z_[i_, k_]*z_[i_, k_]
                along_ += z_[i_, k_]*(eps_[i_] - base_[n_, i_])
            for i_ in range(6):
                trial_[i_] += z_[i_, k_]*along_/part_
        done_ = False
        turns_, cut_ = 0, 0
        level_, before_, slope_ = 0.0, -1.0, 0.0
        low_, up_, factor_ = 0.0, -1.0, 1.0
        # one evaluation per pass; `before_` < 0 marks the first one of a step, which is always taken
        while turns_ < limit_:
            status_, lost_ = point_(trial_, old_, new_, sig_, tangent_, True, work_, c_)
            scale_, strain_, now_, along_ = 0.0, 0.0, 0.0, 0.0
            for i_ in range(6):
                scale_ = max(scale_, abs(sig_[i_]))
                strain_ = max(strain_, abs(trial_[i_]))
                stiff_ = max(stiff_, abs(tangent_[i_, i_]))
            for k_ in range(size_):
                value_ = -goal_[n_, k_]
                scale_ = max(scale_, abs(goal_[n_, k_]))
                for i_ in range(6):
                    value_ += v_[k_, i_]*sig_[i_]
                residual_[k_] = value_
                now_ = max(now_, abs(value_))
                along_ += value_*step_[k_]
            taken_ = before_ < 0.0 or (status_ == 0 and now_ < 0.5*before_)
            if not taken_:
                # line search: on the slope of the convex incremental energy where the system is its gradient, else on the residual
                cut_ += 1
                if symmetric_ and slope_ < 0.0:
                    taken_ = status_ == 0 and (abs(along_) <= 0.8*abs(slope_) or (along_ < 0.0 and up_ < 0.0))
                    if not taken_:
                        if status_ == 0 and along_ < 0.0:
                            low_ = factor_
                        else:
                            up_ = factor_
                        factor_ = 0.5*(low_ + up_)
                else:
                    taken_ = (status_ == 0 and now_ < before_) or cut_ > 8
                    if not taken_:
                        factor_ *= 0.5
                taken_ = taken_ or cut_ > 30
            if taken_:
                turns_ += 1
                for i_ in range(6):
                    start_[i_] = trial_[i_]
                if status_ != 0:
                    break
                # rounding of stiffness times strain bounds what can be reached, but a runaway strain must not excuse a residual
                level_ = max(scale_, 1e-3*highest_)
                before_ = now_
                if now_ <= max(tolerance_*level_, min(4e-15*stiff_*strain_, 1e-8*level_)):
                    done_ = True
                    highest_ = max(highest_, scale_)
                    break
                for k_ in range(size_):
                    for l_ in range(size_):
                        value_ = 0.0
                        for i_ in range(6):
                            if v_[k_, i_] != 0.0:
                                for j_ in range(6):
                                    value_ += v_[k_, i_]*tangent_[i_, j_]*z_[j_, l_]
                        matrix_[k_, l_] = value_
                    step_[k_] = -residual_[k_]
                solve_(matrix_, step_, size_, 1e-13*stiff_)
                slope_ = 0.0
                for k_ in range(size_):
                    slope_ += residual_[k_]*step_[k_]
                low_, up_, factor_, cut_ = 0.0, -1.0, 1.0, 0
            for i_ in range(6):
                value_ = start_[i_]
                for k_ in range(size_):
                    value_ += factor_*z_[i_, k_]*step_[k_]
                trial_[i_] = value_
        if not done_:
            return n_, before_, level_
        for i_ in range(6):
            eps_[i_] = start_[i_]
        total_ += lost_
        for i_ in range(6):
            out_eps_[n_, i_] = eps_[i_]
            out_sig_[n_, i_] = sig_[i_]
        for i_ in range(new_.shape[0]):
            old_[i_] = new_[i_]
            out_state_[n_, i_] = new_[i_]
        out_psi_[n_] = energy_(eps_, new_, work_, c_)
        out_dissipation_[n_] = total_
    return -1, 0.0, highest_
'''
