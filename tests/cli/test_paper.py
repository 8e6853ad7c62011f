"""`orbiflow paper`: options reach the job, mistakes name them."""

from __future__ import annotations

from pathlib import Path

import pytest


def test_some_exhibits(tmp_path: Path, orbiflow) -> None:
    out = tmp_path / "paper"
    outcome = orbiflow(
        "paper", "--out", out, "--fast", "--only", "table-1,Figure 4", "--workers", 1
    )
    assert (outcome.status, outcome.err) == (0, "")
    assert f"open {out / 'index.html'}" in outcome.out
    page = (out / "index.html").read_text("utf-8")
    assert "orbiflow paper --fast" in page
    assert 'id="figure-4"' in page


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--only", "table-9"], "--only: no 'table-9' in the paper; there are figure-1, "),
        (["--workers", 0], "--workers must be at least 1, got 0"),
    ],
)
def test_mistakes(tmp_path: Path, orbiflow, monkeypatch, options, message) -> None:
    monkeypatch.chdir(tmp_path)
    outcome = orbiflow("paper", *options)
    assert outcome.status == 2
    assert message in outcome.err
    assert list(tmp_path.iterdir()) == []
