"""The map of `extreme_states`: every cell is right to its bound, or refused where there is no answer."""

import pytest
from extreme_rows import Cell, evaluate
from extreme_states import CELLS, SUITE


@pytest.mark.parametrize("cell", CELLS, ids=lambda cell: cell.name)
def test_cell(cell: Cell) -> None:
    row = evaluate(SUITE, cell)
    assert row.verdict == ("refused" if cell.says else "right"), row


def test_only_infinite_moduli_are_refused() -> None:
    assert len({cell.name for cell in CELLS}) == len(CELLS) == 40
    assert {cell.group for cell in CELLS if cell.says} == {"infinite moduli"}
