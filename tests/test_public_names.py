"""What the package names at its top is there, and costs nothing until it is used."""

from __future__ import annotations

import subprocess
import sys

import pytest

import orbiflow


@pytest.mark.parametrize("name", orbiflow.__all__)
def test_every_public_name_is_there(name: str) -> None:
    assert getattr(orbiflow, name).__name__ == name
    assert name in dir(orbiflow)


def test_an_unknown_name_is_refused() -> None:
    with pytest.raises(AttributeError, match="orbiflow"):
        _ = orbiflow.tessellate  # pyright: ignore[reportAttributeAccessIssue]


def test_importing_loads_no_numerical_library() -> None:
    script = "import sys, orbiflow; print(sorted({'torch', 'numpy', 'scipy'} & set(sys.modules)))"
    shown = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    assert shown.stdout.strip() == "[]"
