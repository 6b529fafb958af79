"""How a foreseen failure is told: one line, and the exit code that goes with it. A bug keeps its traceback."""

from __future__ import annotations

import errno

import typer

from ..errors import FenchelError

__all__ = ["one_line"]

_NO_ROOM = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG}
_NO_LEAVE = {errno.EACCES, errno.EPERM, errno.EROFS}


def one_line(problem: Exception) -> tuple[str, int]:
    """The line and the exit code of a failure; one that nobody foresaw is raised again."""
    if isinstance(problem, FenchelError):
        text, code = str(problem), problem.exit_code
    elif isinstance(problem, typer.TyperException):
        text, code = problem.format_message().replace("Value error, ", ""), problem.exit_code
        context = getattr(problem, "ctx", None)
        if context is not None:
            text += f' (see "{context.command_path} --help")'
    elif isinstance(problem, typer.Abort):
        text, code = "stopped", 130
    elif isinstance(problem, MemoryError):
        text, code = "out of memory: take fewer grains or points, or a machine with more memory", 1
    elif isinstance(problem, OSError) and problem.errno is not None:
        text, code = _of_system(problem)
    else:
        raise problem
    return "fenchel: " + " ".join(text.split()), code


def _of_system(problem: OSError) -> tuple[str, int]:
    where = f"{problem.filename}: " if problem.filename is not None else ""
    what = problem.strerror or str(problem)
    if problem.errno in _NO_ROOM:
        return (
            f"{where}no space left to write ({what}); what was written before is kept: free some space, then run it again",
            1,
        )
    if problem.errno in _NO_LEAVE:
        return f"{where}not permitted ({what}): choose a place that you may read and write", 1
    if isinstance(problem, IsADirectoryError):
        return f"{where}{what}: name a file, as in {problem.filename or 'FOLDER'}/NAME", 2
    if isinstance(problem, FileNotFoundError | NotADirectoryError | FileExistsError):
        return f"{where}{what}: give the path of an existing file", 2
    return f"{where}{what}", 1
