"""What docs/testing.md shows works as it stands there."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "testing.md").read_text(encoding="utf-8")


def test_the_examples_of_the_page_pass(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    examples = re.findall(r"^```python\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)
    names: dict[str, object] = {}
    exec("".join(examples), names)
    tests = [each for name, each in names.items() if name.startswith("test_") and callable(each)]
    for test in tests:
        test()
    assert len(tests) == len(examples) == 3
