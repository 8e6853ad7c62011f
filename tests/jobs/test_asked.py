"""From requests to settings: what was set, texts that are read, and errors that name the field."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given as drawn
from hypothesis import strategies as st

from orbiflow.errors import OrbiflowError
from orbiflow.jobs import EscherizeRequest, RecordError
from orbiflow.jobs.asked import given, read_as
from orbiflow.units import length


def test_what_was_set_is_given_and_nothing_else() -> None:
    request = EscherizeRequest(image=Path("x"), min_neck=0.1, figures=False)
    found = given(request, ("min_neck", "effort", "figures"))
    assert found == {"min_neck": 0.1, "figures": False}


def test_a_text_is_read() -> None:
    assert read_as("kerf", length, "2 cm") == 20.0


def test_an_error_names_the_field_as_it_is_called_where_it_is_read() -> None:
    with pytest.raises(RecordError, match=r"^tile_size '40' has no unit") as caught:
        read_as("tile_size", length, "40")
    assert caught.value.named(lambda field: f"--{field}").startswith("--tile_size '40' has")
    assert isinstance(caught.value.__cause__, OrbiflowError)


@drawn(st.text(st.sampled_from("{}ab_1mm "), max_size=12))
def test_what_the_user_wrote_names_no_field(text: str) -> None:
    def refuse(given: str) -> None:
        raise OrbiflowError(f"{given!r} is wrong")

    with pytest.raises(RecordError) as caught:
        read_as("kerf", refuse, text)
    asked: list[str] = []
    caught.value.named(lambda field: asked.append(field) or field)
    assert asked == ["kerf"]


def test_other_errors_are_not_disguised() -> None:
    def fail(_: str) -> None:
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        read_as("kerf", fail, "1mm")


def test_a_field_that_the_request_has_not_is_a_mistake() -> None:
    with pytest.raises(AttributeError):
        given(EscherizeRequest(image=Path("out")), ("eyes",))
