"""The map of `extreme_scenes`: every cell is right to its bound, or refused with a reason where that was foreseen."""

import pytest
from extreme_rows import Cell, evaluate
from extreme_scenes import CELLS, REFUSABLE, SUITE


@pytest.mark.parametrize("cell", CELLS, ids=lambda cell: cell.name)
def test_cell(cell: Cell) -> None:
    row = evaluate(SUITE, cell)
    assert row.verdict in ("right", "refused"), row


def test_few_cells_may_be_refused() -> None:
    assert len({cell.name for cell in CELLS}) == len(CELLS) == 47
    assert {cell.name for cell in CELLS if cell.says} == REFUSABLE
    assert len(REFUSABLE) <= len(CELLS) / 10
