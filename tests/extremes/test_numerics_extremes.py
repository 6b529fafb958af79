"""The map of `extreme_numerics`: every cell is right to its bound, or refused with a reason where that was foreseen."""

import pytest
from extreme_numerics import CELLS, SUITE
from extreme_rows import Cell, evaluate


def marks(cell: Cell):
    return pytest.mark.validate if cell.long else ()


@pytest.mark.parametrize("cell", [pytest.param(c, id=c.name, marks=marks(c)) for c in CELLS])
def test_cell(cell: Cell) -> None:
    row = evaluate(SUITE, cell)
    assert row.verdict in ("right", "refused"), row
    assert row.verdict == "right" or len(row.message) > 20


def test_few_cells_may_be_refused() -> None:
    assert len({cell.name for cell in CELLS}) == len(CELLS)
    assert sum(bool(cell.says) for cell in CELLS) <= len(CELLS) / 10
