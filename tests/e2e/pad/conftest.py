"""A browser and a pad for each file of tests."""

import pytest

from tests.web import chromium, serving_pad

# Playwright waits by itself for what it is asked for, so long at most.
_PATIENCE_MS = 60_000


@pytest.fixture(scope="module")
def pad():
    with serving_pad() as (_, url):
        yield url


@pytest.fixture(scope="module")
def browser():
    with chromium() as started:
        yield started


@pytest.fixture
def visit(browser):
    """Return what opens a page; what goes wrong in a page fails the test."""
    contexts, faults = [], []

    def opened(url, place="kitchen", context=None, **options):
        if context is None:
            context = browser.new_context(
                **{"viewport": {"width": 1280, "height": 860}, "locale": "en-GB", **options}
            )
            context.set_default_timeout(_PATIENCE_MS)
            contexts.append(context)
        page = context.new_page()
        page.on("pageerror", lambda error: faults.append(str(error)))
        page.on("console", lambda said: faults.append(said.text) if is_fault(said) else None)
        page.goto(url)
        page.get_by_test_id("map-thing-0").wait_for()
        if place:
            page.get_by_test_id("open-places").click()
            page.get_by_test_id(f"place-{place}").click()
            page.get_by_test_id(f"place-{place}").wait_for(state="hidden")
            page.locator(".map-pane .title", has_text=place.capitalize()).wait_for()
        return page

    yield opened
    for context in contexts:
        context.close()
    assert not faults


def is_fault(said):
    # A server that is away is what some tests are about, and browsers tell of it.
    return said.type == "error" and "net::ERR" not in said.text and "status of" not in said.text
