"""Lengths need a number and a unit that is known."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from orbiflow.settings import MILLIMETRES, Length, LengthOrZero, PageSize, length
from orbiflow.settings.kinds import Refused, kind_of
from orbiflow.settings.units import length_or_none, page_size, signed_length, size
from refusals import refused


@given(st.floats(1e-3, 1e3), st.sampled_from(list(MILLIMETRES)))
def test_what_is_written_is_read(number: float, unit: str) -> None:
    assert math.isclose(length(f" {number!r} {unit.upper()} "), number * MILLIMETRES[unit])
    width, height = size(f"{number!r}{unit}x2cm")
    assert math.isclose(width, number * MILLIMETRES[unit])
    assert height == 20


@pytest.mark.parametrize(
    ("text", "about"),
    [
        *(("40", "40mm"), ("40px", "'px'"), ("mm", "40mm"), ("", "length"), ("-3mm", "-3mm")),
        *(("1e9mm", "100 m"), ("1e999mm", "100 m"), ("nanmm", "nanmm"), ("40mm cm", "40mm cm")),
    ],
)
def test_no_lengths(text: str, about: str) -> None:
    with refused(about):
        length(text)


@pytest.mark.parametrize("text", ["0", "0.0 mm"])
def test_zero_where_it_is_one(text: str) -> None:
    assert length(text) == kind_of(LengthOrZero).read(text) == 0
    with refused(0, 20000, kind=Refused):
        kind_of(Length).read(text)


@pytest.mark.parametrize(
    ("text", "about"),
    [
        *(("300x200", "300x200mm"), ("300mm", "300x200mm"), ("300x200x10mm", "300x200mm")),
        *(("-3x200mm", "300x200mm"), ("300x200ft", "'ft'")),
    ],
)
def test_no_sizes(text: str, about: str) -> None:
    with refused(about):
        size(text)


def test_no_size_is_without_area() -> None:
    with refused("entry 1", "0.0", kind=Refused):
        kind_of(PageSize).read("0x200mm")


@pytest.mark.parametrize(
    ("text", "page"),
    [
        *(("A4", (210, 297)), ("a4-Landscape", (297, 210)), ("mug", (228.6, 88.9))),
        *(("mug-portrait", (88.9, 228.6)), ("tabloid", (279.4, 431.8)), ("double", (180, 120))),
        ("1in x 5cm", (25.4, 50)),
    ],
)
def test_pages_by_name(text: str, page: tuple[float, float]) -> None:
    assert page_size(text) == pytest.approx(page)


@pytest.mark.parametrize("text", ["A9", "A4-upright", "paper", ""])
def test_pages_that_nobody_knows(text: str) -> None:
    with refused(text, "a4", "letter", "-landscape"):
        page_size(text)


def test_posts_are_pixels_whatever_the_resolution() -> None:
    for dpi in (72, 600):
        assert page_size("Square", dpi) == pytest.approx((1080 * 25.4 / dpi, 1080 * 25.4 / dpi))
    with refused("page"):
        page_size("square")


@given(st.floats(0.01, 1e3), st.floats(1, 1e4))
def test_pixels_have_a_size_where_their_number_in_an_inch_is_known(
    number: float, dpi: float
) -> None:
    assert math.isclose(length(f"{number!r}px", dpi), number * 25.4 / dpi)
    assert size(f"{number!r}x3px", dpi)[1] == pytest.approx(3 * 25.4 / dpi)
    assert length_or_none("None", dpi) == 0
    with refused("px", "mm", "pt"):
        length(f"{number!r}px")
    with refused("mm", "in", "px"):
        length(f"{number!r}", dpi)


@given(st.floats(0.01, 1e3))
def test_a_sign_before_a_length(number: float) -> None:
    assert signed_length(f" -{number!r}mm") == -signed_length(f"{number!r}mm") == -number
    with refused("length"):
        signed_length(f"--{number!r}mm")
