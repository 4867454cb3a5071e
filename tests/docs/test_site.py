"""The site: it builds without a warning, and a browser shows every page of it."""

import functools
import http.server
import os
import shutil
import subprocess
import sys
import threading

import pytest
from playwright.sync_api import sync_playwright
from sphinx.util.inventory import InventoryFile

import bilayer_core

pytestmark = pytest.mark.slow
FLAGS = ["--no-sandbox", "--disable-gpu", "--disable-background-networking", "--disable-component-update"]


@pytest.fixture(scope="module")
def site(root, tmp_path_factory):
    """The folder of the site; a link that leads nowhere is a warning, and a warning is an error."""
    directory = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "-d", directory / "trees"]
    done = subprocess.run(
        [*command, root / "docs", directory / "html"],
        env=os.environ | {"PYTHONPATH": str(root)},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    return directory / "html"


@pytest.fixture(scope="module")
def address(site):
    class Silent(http.server.SimpleHTTPRequestHandler):
        def log_message(self, *_):
            pass

    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Silent, directory=site))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{server.server_port}"
    server.shutdown()


@pytest.fixture(scope="module")
def page(address):
    """A page of a browser that reaches this machine alone, with what goes wrong on it in `faults`."""
    if not (chromium := shutil.which("chromium")):
        pytest.skip("no chromium")
    with sync_playwright() as play:
        browser = play.chromium.launch(executable_path=chromium, args=FLAGS)
        page = browser.new_page(viewport={"width": 1280, "height": 900})
        page.faults = []
        page.on("console", lambda said: page.faults.append(said.text) if said.type == "error" else None)
        page.on("pageerror", lambda fault: page.faults.append(str(fault)))
        page.on("requestfailed", lambda request: page.faults.append(f"no answer: {request.url}"))
        page.route(lambda url: not url.startswith(address), lambda route: route.abort())
        yield page
        browser.close()


def test_the_reference_has_every_public_name(site):
    with (site / "objects.inv").open("rb") as file:
        listed = {
            name for objects in InventoryFile.load(file, "", lambda *parts: parts[-1]).values() for name in objects
        }
    public = {f"bilayer_core.{name}" for name in bilayer_core.__all__} - {"bilayer_core.__version__"}
    assert public <= listed


def test_a_browser_shows_every_page_without_a_fault_and_without_the_network(site, address, page):
    names = sorted(path.relative_to(site).as_posix() for path in site.rglob("*.html") if "_static" not in path.parts)
    assert len(names) > 30
    for name in names:
        page.goto(f"{address}/{name}", wait_until="load")
        assert page.title()
        missing = page.evaluate("Array.from(document.images).filter(i => !i.naturalWidth).map(i => i.src)")
        assert (name, missing, page.faults) == (name, [], [])


def test_the_films_on_the_first_page_play(address, page):
    page.goto(address, wait_until="load")
    films = page.locator("img[src$='.webp']").all()
    assert len(films) == 9
    before = [film.screenshot() for film in films]
    page.wait_for_timeout(700)
    assert all(film.screenshot() != first for film, first in zip(films, before, strict=True))


def test_the_search_finds_a_word_of_the_pages(address, page):
    page.goto(f"{address}/search.html?q=eigenstrain", wait_until="load")
    page.wait_for_selector("#search-results ul.search li", timeout=10_000)
    found = page.locator("#search-results ul.search li a").all_inner_texts()
    assert any("Stimuli" in title for title in found), found
    assert not page.faults
