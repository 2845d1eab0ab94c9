"""What docs/testing.md shows works as it stands there."""

import re
from pathlib import Path

PAGE = (Path(__file__).parents[2] / "docs" / "testing.md").read_text(encoding="utf-8")


def test_the_example_of_the_page_passes() -> None:
    (example,) = re.findall(r"^```python\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)
    names: dict[str, object] = {}
    exec(example, names)
    tests = [each for name, each in names.items() if name.startswith("test_") and callable(each)]
    for test in tests:
        test()
    assert len(tests) == 1
