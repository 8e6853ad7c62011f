"""States of pages that pass quickly, and failures, in a real browser."""

import pytest

from studio_checks import serious_issues, untidy_parts
from studio_states import STATES, Visit

PASSING = [
    *("start-full", "start-many", "start-rename", "picture-doubts", "picture-failed"),
    *("search-waiting", "search-sketches", "search-paused", "search-nothing"),
    *("take-thin", "take-running", "take-refused", "density-empty", "lost"),
    *("solid-ready", "solid-refused", "solid-searching"),
]


@pytest.mark.parametrize("name", PASSING)
def test_nothing_is_cut_off_and_nobody_kept_out(page, studio, searched, name: str) -> None:
    page.emulate_media(color_scheme="dark")
    STATES[name](Visit(page, studio.project(searched), density=""))
    assert untidy_parts(page, 1440, 360) == []
    assert serious_issues(page) == []


def test_a_thousand_projects_are_shown_when_they_are_asked_for(page, studio, searched) -> None:
    STATES["start-many"](Visit(page, studio.project(searched), density=""))
    assert page.locator(".project").count() == 10
    page.get_by_role("button", name="Show all 1000").click()
    page.wait_for_selector(".project >> nth=999")
