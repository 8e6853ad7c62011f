"""States of pages that pass quickly, and failures, in a real browser."""

from typing import Any

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


def test_what_is_left_is_told_by_the_pace_that_was_measured(page: Any) -> None:
    page.goto("/")
    told = page.evaluate("""async () => {
        const { timeLeft } = await import("/js/waiting.js");
        let now = 0;
        performance.now = () => now;
        const task = (id, share, usual) => ({ id, share, usual, state: "running" });
        const first = [timeLeft(task(1, 0)), timeLeft(task(2, 0.25, 40))];
        now = 10_000;
        return [...first, timeLeft(task(1, 0.25)), timeLeft({ id: 1, state: "paused" })];
    }""")
    assert told == ["", "about 30 s more", "about 30 s more", ""]
