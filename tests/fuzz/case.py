"""One case: what it is called, how it is run, and what counts as a failure whatever the target."""

from __future__ import annotations

import base64
import contextlib
import hashlib
import importlib
import io
import json
import signal
import traceback
import warnings
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from fenchel.errors import FenchelError

__all__ = ["LIMIT", "TARGETS", "Failure", "Hang", "Outcome", "command", "digest_of", "foreseen", "line_of", "run_line"]

TARGETS = ("laws", "scenes", "files", "contacts")
LIMIT = 240.0
"""Processor seconds of one case, generated code included; above it the case hangs."""


class Failure(Exception):
    """What must not happen, in one line."""


class Hang(BaseException):
    """Raised in a case that takes longer than it may; no `except Exception` of the code under test catches it."""


@dataclass(frozen=True)
class Outcome:
    """`line` names the case; `verdict` is a word; `failure` is empty if nothing is wrong; `trace` says where it happened."""

    line: str
    verdict: str
    failure: str = ""
    trace: str = ""


def target_named(name: str) -> Any:
    """The module of a target."""
    if name not in TARGETS:
        raise SystemExit(f"fuzz: target {name!r} is not known: one of {', '.join(TARGETS)}")
    return importlib.import_module(f".{name}", __package__)


def digest_of(*parts: str | bytes) -> str:
    """Eight hexadecimal digits of a case."""
    found = hashlib.sha256()
    for part in parts:
        found.update(part if isinstance(part, bytes) else part.encode())
        found.update(b"\0")
    return found.hexdigest()[:8]


def pack(case: Any) -> str:
    """A case of plain data as one word."""
    return base64.urlsafe_b64encode(zlib.compress(json.dumps(case, sort_keys=True).encode(), 9)).decode()


def unpack(word: str) -> Any:
    """Inverse of `pack`."""
    return json.loads(zlib.decompress(base64.urlsafe_b64decode(word)))


def line_of(target: str, seed: int) -> str:
    """The line under which a failing case is kept: with its digest, or the case itself."""
    module = target_named(target)
    case = module.draw(seed)
    return f"{target} ={pack(case)}" if module.PLAIN else f"{target} {seed} {module.digest(case)}"


def drawn(line: str) -> tuple[Any, Any]:
    """(module, case) of a line; `Failure` where the seed no longer draws the case that the line is about."""
    words = line.split()
    module = target_named(words[0])
    if words[1].startswith("="):
        return module, unpack(words[1][1:])
    case = module.draw(int(words[1]))
    if len(words) > 2 and module.digest(case) != words[2]:
        raise Failure(
            f"seed {words[1]} draws another case than the one that failed (digest {module.digest(case)}, not {words[2]}): "
            "the generator has changed; find the case anew or give it a test of its own"
        )
    return module, case


@contextlib.contextmanager
def limited(seconds: float) -> Iterator[None]:
    """Raise `Hang` after so many seconds of the processor."""

    def late(*_: Any) -> None:
        raise Hang

    before = signal.signal(signal.SIGPROF, late)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)


def run_line(line: str, limit: float = LIMIT) -> Outcome:
    """Run one case. Any exception that the target does not know how to take is a failure, and so is a `RuntimeWarning`."""
    try:
        with limited(limit), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            warnings.simplefilter("error", RuntimeWarning)
            module, case = drawn(line)
            return Outcome(line, module.judge(case))
    except Failure as failure:
        return Outcome(line, "failure", " ".join(str(failure).split()))
    except Hang:
        where = traceback.format_exc(limit=-6)
        return Outcome(line, "failure", f"hangs: more than {limit:g} s of the processor", where)
    except Exception as error:
        said = " ".join(str(error).split())[:300]
        return Outcome(line, "failure", f"{type(error).__name__}: {said}", traceback.format_exc(limit=-8))


def foreseen(error: FenchelError) -> str:
    """The verdict of a foreseen error, which has to be one line of a sensible length."""
    text = str(error)
    if "\n" in text or not text.strip() or len(text) > 2000:
        raise Failure(f"{type(error).__name__} with a message that is not one line: {text[:200]!r}")
    return f"refused ({type(error).__name__})"


def command(*arguments: str) -> tuple[int, str, str]:
    """(exit code, standard output, standard error) of the command line, run in this process."""
    from fenchel.cli import main

    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = main(list(arguments))
    if code not in (0, 1, 2):
        raise Failure(f"exit code {code} of fenchel {' '.join(arguments)}")
    said = err.getvalue().strip()
    if code == 2 and (len(said.splitlines()) != 1 or not said.startswith("fenchel: ")):
        raise Failure(
            f"exit code 2 of fenchel {' '.join(arguments)} with {len(said.splitlines())} lines: {said[:300]!r}"
        )
    if "Traceback" in said:
        raise Failure(f"a traceback of fenchel {' '.join(arguments)}: {said[-300:]!r}")
    return code, out.getvalue(), said
