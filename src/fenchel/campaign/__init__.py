"""Campaigns: independent tasks, some of which need others first, on the local cores or on a cluster.

A task leaves its result in a file, which is its checkpoint too; a campaign that was stopped goes on with what is not finished, and a
task whose worker died is tried again.
"""

from .computation import Computation
from .engines import Engine, LocalEngine, engine_of
from .run import run_campaign
from .task import Task, awaited_by, progress_file, read_progress, report_progress

__all__ = [
    "Computation", "Engine", "LocalEngine", "Task", "awaited_by", "engine_of", "progress_file", "read_progress", "report_progress",
    "run_campaign",
]  # fmt: skip
