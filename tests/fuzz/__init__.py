"""Search for failures: seeded random cases of laws, scenes, files and contact problems, each judged by what must never happen.

    make fuzz SECONDS=600 TARGET=laws            # or, without make, from the checkout:
    PYTHONPATH=tests .venv/bin/python -m fuzz --seconds 600 laws contacts
    PYTHONPATH=tests .venv/bin/python -m fuzz --case "laws 48213"

A case is one line, `TARGET SEED` or `TARGET SEED DIGEST` or `TARGET =TEXT`, in `tests/regression/fuzz_cases.txt`:

* SEED alone: whatever the generator draws from that seed today. A sample of what is searched; it never goes out of date.
* SEED with DIGEST: the failure that was once found there. The digest is of the case that was drawn (law and values; matrices of a contact
  problem): when a generator changes, the seed draws something else, the digest no longer fits, and the test of the line says so instead
  of passing for nothing. Then find the case anew, or give it a test of its own.
* =TEXT: the case itself, in base64 of compressed JSON: what scenes and files that failed are kept as, since they are text or bytes.

Each target is a module with `draw(seed)`, `digest(case)` and `judge(case)`, which returns a word such as "answer" or "refused" and raises
`Failure`; cases of a target that is `PLAIN` are plain data. Cases run in a child process that writes down what it is about to do, so that a
crash or a hang is a failure of that case and the search goes on behind it.
"""
