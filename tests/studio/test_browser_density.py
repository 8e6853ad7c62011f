"""The density page in a real browser: from a table to files, by mouse and by keys."""

import re
from typing import Any

import numpy as np
import pytest

from orbiflow.density import DensityLevels, conditional, read_density
from studio.browser import RunningStudio
from studio_checks import serious_issues, untidy_parts

ROWS = 30
TABLE = "phi,psi\n" + "".join(
    f"{v:.1f},{50 * np.sin(v):.1f}\n" for v in np.linspace(-170, 170, ROWS)
)


def new_density(studio: RunningStudio) -> str:
    """The number of a new density."""
    return studio.client.post("projects", json={"kind": "density"}).json()["id"]


def give(page: Any, table: str) -> None:
    file = {"name": "table.csv", "mimeType": "text/csv", "buffer": table.encode()}
    page.set_input_files("input[type=file]", file)


@pytest.fixture(scope="module", name="fitted")
def fitted_fixture(studio: RunningStudio) -> str:
    """A density of two angles."""
    own = new_density(studio)
    studio.client.put(f"projects/{own}/density/table", params={"name": "bends.csv"}, content=TABLE)
    studio.until(lambda: studio.client.get(f"projects/{own}/density").json()["table"])
    settings = {"space": "torus", "columns": ["phi", "psi"], "unit": "degrees"}
    body = {"operation": "density fit", "settings": settings}
    studio.client.post(f"projects/{own}/tasks", json=body)
    studio.until(lambda: studio.client.get(f"projects/{own}/density").json()["fit"])
    return own


def test_a_fit_is_begun_held_and_stopped(page: Any, studio: RunningStudio) -> None:
    page.goto(f"/#/d/{new_density(studio)}")
    give(page, TABLE)
    assert page.get_by_role("radio", name=re.compile("^Angles")).is_checked()
    assert page.get_by_role("cell", name="−170", exact=True).is_visible()
    assert serious_issues(page) == []
    page.get_by_role("button", name="Fit the density").click()
    page.get_by_role("button", name="Pause").click()
    page.get_by_role("button", name="Go on").wait_for()
    page.reload()
    page.get_by_role("button", name="Go on").click()
    page.wait_for_selector(".watch .parts li")
    page.get_by_role("button", name="Stop").click()
    page.get_by_role("button", name="Fit the density").wait_for()


def test_hours_are_fitted_as_hours_and_unsaid_columns_are_asked_for(
    page: Any, studio: RunningStudio
) -> None:
    page.goto(f"/#/d/{new_density(studio)}")
    rows = "hour,minutes,when\n" + "".join(f"{k % 24}.5,{5 * k},9:30\n" for k in range(40))
    give(page, rows)
    fit = page.get_by_role("button", name="Fit the density")
    assert page.get_by_label("How is hour counted?").input_value() == "cycle:24"
    assert "Not shown: when," in page.inner_text(".density")
    assert fit.is_enabled()
    page.get_by_label("minutes", exact=True).check()
    assert fit.is_disabled()
    assert "Say how minutes is counted." in page.inner_text(".density")
    page.get_by_label("How is minutes counted?").select_option("angle:degrees")
    with page.expect_request(lambda request: request.url.endswith("/tasks")) as caught:
        fit.click()
    columns = caught.value.post_data_json["settings"]["columns"]
    assert columns == ["hour=cycle:24", "minutes=angle:degrees"]


def test_a_fit_is_told_in_words_and_new_rows_are_taken_away(page: Any, fitted: str) -> None:
    page.goto(f"/#/d/{fitted}")
    page.get_by_text(re.compile("times as likely as by chance$")).wait_for()
    assert f"over all {ROWS} rows" in page.inner_text(".density")
    page.get_by_label("How many").fill("7")
    page.get_by_role("button", name="Draw rows").click()
    with page.expect_download() as caught:
        page.get_by_role("link", name=re.compile("samples.csv")).click()
    assert len(caught.value.path().read_text().splitlines()) == 8


def test_all_is_done_by_keys_and_fits_a_phone(page: Any, fitted: str) -> None:
    page.set_viewport_size({"width": 360, "height": 700})
    page.emulate_media(color_scheme="dark")
    page.goto(f"/#/d/{fitted}")
    region = page.get_by_role("slider", name="Show the smallest region that holds")
    page.wait_for_selector("canvas.map[aria-label]")
    region.focus()
    for _ in range(10):
        page.keyboard.press("ArrowLeft")
    assert "90 % of all rows to come" in page.inner_text(".controls")
    surface = page.locator(".turned canvas")
    before = page.locator(".turned .label").first.evaluate("own => own.style.left")
    surface.focus()
    page.keyboard.press("ArrowRight")
    moved = "before => document.querySelector('.turned .label').style.left !== before"
    page.wait_for_function(moved, arg=before)
    page.get_by_role("radio", name="ψ").check()
    held = page.get_by_role("slider", name="ψ is held at")
    held.focus()
    page.keyboard.press("End")
    assert held.get_attribute("aria-valuetext") == "ψ = 180°"
    assert untidy_parts(page) == []
    assert serious_issues(page) == []


def test_regions_and_conditionals_are_those_of_the_density(page, studio, fitted) -> None:
    fit = studio.client.get(f"projects/{fitted}/density").json()["fit"]
    (file,) = studio.folder.glob(f"projects/{fitted}/fits/*/model/density.safetensors")
    density = read_density(file)[0]
    data = studio.client.get(f"projects/{fitted}/density/{fit['number']}/map?axes=0-1").json()
    page.goto(f"/#/d/{fitted}")
    areas, slices = page.evaluate(
        """async data => {
            const { Grid } = await import("/js/density/grid.js");
            const grid = new Grid(data, "torus");
            const areas = [0.3, 0.6, 0.9].map(share => grid.region(share).area);
            return [areas, [0, 1].map(axis => grid.slice(axis, 0.3, 90))];
        }""",
        data,
    )
    levels = DensityLevels(density, samples=20_000)
    exact = [levels.highest(share).fraction for share in (0.3, 0.6, 0.9)]
    np.testing.assert_allclose(areas, np.array(exact, dtype=np.float64), rtol=0.05)
    turns = (np.arange(90)[:, None] + 0.5) / 90 - 0.5
    for axis, found in enumerate(slices):
        own = conditional(density, {axis: 0.3 - 0.5})
        values = own.log_prob(own.space.to_chart(360 * turns), measure="uniform").exp().numpy()
        np.testing.assert_allclose(found, values, rtol=0.1, atol=0.02)


def test_maps_and_their_inverses_agree(page: Any, fitted: str) -> None:
    page.goto(f"/#/d/{fitted}")
    worst = page.evaluate(
        """async () => {
            const { Grid } = await import("/js/density/grid.js");
            const cells = [4, 8], logs = btoa("\\0".repeat(4 * 32));
            const shade = { low: 0, high: 1, log: false };
            let worst = 0;
            for (const space of ["sphere", "projective-plane"]) {
                const { map } = new Grid({ kind: "globe", cells, logs, shade }, space);
                for (let k = 1; k < 400; k += 1) {
                    const x = (k * 0.618) % 1, y = (k * 0.414) % 1, place = map.place(x, y);
                    if (!place) continue;
                    const [a, b] = map.spot(...place);
                    worst = Math.max(worst, Math.abs(a - x), Math.abs(b - y));
                }
            }
            return worst;
        }"""
    )
    assert 0 < worst < 1e-6
