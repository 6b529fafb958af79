"""Kernels written for one kind of scene: `SceneKernels` assembles them from the dimension, the bodies and the laws, and from nothing else.

The texts (`pair_text`, `plane_text`, `link_text`, `body_text`, `detection_text`, `step_text`) are written in the little language of `text`.
"""

from .scene_kernels import Kernel, SceneKernels, detection

__all__ = ["Kernel", "SceneKernels", "detection"]
