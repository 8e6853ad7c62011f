"""Pages come from templates, and show what users wrote as text."""

import sys
from pathlib import Path

import pytest
from jinja2 import UndefinedError

from orbiflow.drawing import rendered
from refusals import refused

TEMPLATE = """{% extends "web_page.html" %}
{% block style %}{% include "own.css" %}{% endblock %}
{% block body %}
<p>{{ text }}</p>
{% endblock %}
"""


@pytest.fixture(name="package")
def package_fixture(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    home = tmp_path / "some_pages"
    home.mkdir()
    (home / "__init__.py").touch()
    (home / "page.html").write_text(TEMPLATE)
    (home / "own.css").write_text("p > b { color: red; }\n")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, home.name, raising=False)
    return home.name


def test_texts_are_escaped_and_styles_are_not(package: str) -> None:
    page = rendered(package, "page.html", title="a < b", text="<script>&")
    assert page.startswith("<!DOCTYPE html>\n<html lang")
    assert page.endswith("<body>\n<p>&lt;script&gt;&amp;</p>\n</body>\n</html>\n")
    assert "<title>a &lt; b</title>" in page
    assert "p > b { color: red; }" in page
    assert "prefers-color-scheme" in page


def test_a_page_that_is_never_dark(package: str) -> None:
    page = rendered(package, "page.html", title="", text="", dark=False)
    assert "prefers-color-scheme" not in page


def test_a_name_that_is_not_given(package: str) -> None:
    with refused("text", kind=UndefinedError):
        rendered(package, "page.html", title="")
