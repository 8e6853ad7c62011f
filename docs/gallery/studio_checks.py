"""What keeps people out of a page of the studio, or does not fit on it, in any browser and font."""

from __future__ import annotations

from typing import Any

UNTIDY = """() => {
    const shown = [...document.querySelectorAll("#top *, #page *, dialog[open] *")].filter((own) =>
        own.checkVisibility({ visibilityProperty: true }) && !own.closest(".unseen, svg"));
    const within = (own, test) => { while (own && !test(own)) own = own.parentElement; return own; };
    const scrolls = (own) => ["auto", "scroll"].includes(getComputedStyle(own).overflowX);
    const lifted = (own) => ["absolute", "fixed", "sticky"].includes(getComputedStyle(own).position);
    const called = (own) => `${own.tagName} ${own.className} ${own.innerText ?? ""}`.slice(0, 80);
    const faults = [];
    for (const own of shown) {
        const { left, right } = own.getBoundingClientRect();
        const beyond = left < -1 || right > innerWidth + 1;
        if (beyond && !within(own, scrolls)) faults.push(`beyond the window: ${called(own)}`);
        const words = own.matches("button, .button, .choice span, .tag, .badge")
            || getComputedStyle(own).overflowX === "hidden";
        const cut = words && own.innerText && own.scrollWidth > own.clientWidth + 1;
        if (cut) faults.push(`cut off: ${called(own)}`);
    }
    const kinds = "a[href], button, select, summary, input:not([type=radio], [type=checkbox])";
    const controls = shown.filter((own) => own.matches(kinds) && !within(own, lifted));
    controls.forEach((one, k) => controls.slice(k + 1).forEach((other) => {
        const [a, b] = [one, other].map((own) => own.getBoundingClientRect());
        const wide = Math.min(a.right, b.right) - Math.max(a.left, b.left);
        const high = Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top);
        if (wide <= 1 || high <= 1 || one.contains(other)) return;
        faults.push(`one over another: ${called(one)}; ${called(other)}`);
    }));
    const more = document.documentElement.scrollWidth - innerWidth;
    return more > 0 ? [...faults, `the page is ${more} pixels wider than the window`] : faults;
}"""


SETTLED = """() => document.getAnimations().forEach((own) => {
    if (own instanceof CSSTransition) own.finish();
})"""

VIOLATIONS = """async () => (await axe.run({ resultTypes: ["violations"] })).violations"""


def untidy_parts(page: Any, *widths: int) -> list[str]:
    """Return what is beyond the window, cut off, or over another control.

    Args:
        page: The page.
        widths: Widths in pixels that the window is given, in turn; by default it stays as it is.
    """
    found = list[str]()
    for width in widths or (page.viewport_size["width"],):
        page.set_viewport_size({**page.viewport_size, "width": width})
        found += [f"{width} pixels: {fault}" for fault in page.evaluate(UNTIDY)]
    return found


def serious_issues(page: Any) -> list[str]:
    """Return what axe finds on a page that keeps people out, with the elements."""
    from axe_playwright_python.base import AXE_SCRIPT

    page.evaluate(SETTLED)  # a colour on its way to another one has a contrast of its own
    if not page.evaluate("'axe' in window"):
        page.evaluate(AXE_SCRIPT)
    found = page.evaluate(VIOLATIONS)
    return [
        f"{issue['id']}: {node['target']} {node['failureSummary']}"
        for issue in found
        if issue["impact"] in ("serious", "critical")
        for node in issue["nodes"]
    ]
