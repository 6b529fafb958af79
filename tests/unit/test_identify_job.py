"""The main job from outside: nothing of the user's is written over."""

from __future__ import annotations

from pathlib import Path

import pytest

from fenchel.errors import InputError
from fenchel.identify.job import run_study


@pytest.mark.parametrize("name", ["study.toml", "law.py"])
def test_a_study_or_law_of_the_user_is_not_written_over(tmp_path: Path, name: str) -> None:
    mine = tmp_path / name
    mine.write_text("# mine\n")
    with pytest.raises(InputError, match="is there already") as info:
        run_study(None, tmp_path)
    assert "\n" not in str(info.value) and info.value.exit_code == 2
    assert mine.read_text() == "# mine\n"
    assert [path.name for path in tmp_path.iterdir()] == [name]
