"""Steps of material points as numba text: written for the layout of a state and the components that exist, compiled once per machine."""

from .store import step_kernel, step_text, terms_kernel, trial_kernel

__all__ = ["step_kernel", "step_text", "terms_kernel", "trial_kernel"]
