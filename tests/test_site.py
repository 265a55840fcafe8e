"""The documentation site, built as ``make docs`` does it and opened in a real Chromium without network."""

import functools
import html.parser
import http.server
import json
import queue
import re
import shutil
import subprocess
import sys
import threading
from pathlib import Path
from urllib.parse import unquote

import pytest

HERE = Path(__file__).parents[1]
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
pytestmark = pytest.mark.slow

#: Opens every page at two widths, one after the other, and tells what is wrong with it.
LOOK = """<!doctype html><meta charset="utf-8">
<iframe id="frame"></iframe><script>
const pages = PAGES, found = [];
const frame = document.getElementById("frame");
const open = (page, width) => new Promise(done => {
  frame.style.width = width + "px"; frame.style.height = "900px";
  frame.onload = () => setTimeout(done, 30); frame.src = page;
});
(async () => {
  for (const page of pages) for (const width of page.includes("/reference/") ? [390] : [1400, 390]) {
    await open("/" + page, width);
    const inside = frame.contentDocument;
    const images = [...inside.images].map(image => { image.loading = "eager"; return image; });
    await Promise.all(images.map(image => image.decode().catch(() => 0)));
    found.push({page, width, wide: inside.documentElement.scrollWidth - width,
                missing: images.filter(image => !image.naturalWidth).map(image => image.src),
                heading: (inside.querySelector("h1") || {}).innerText || ""});
  }
  await open("/search.html?q=conductor", 1400);
  for (let i = 0; i < 100 && !frame.contentDocument.querySelector("#search-results li"); i++)
    await new Promise(done => setTimeout(done, 50));
  const hits = frame.contentDocument.querySelectorAll("#search-results li a");
  found.push({search: [...hits].map(a => a.innerText)});
  await fetch("/found", {method: "POST", body: JSON.stringify(found)});
})();
</script>"""


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The folder of the built site; a warning would have ended the build."""
    target = tmp_path_factory.mktemp("site")
    built = subprocess.run(
        [
            sys.executable,
            "-m",
            "sphinx",
            "--fail-on-warning",
            "--keep-going",
            "-q",
            "-c",
            "docs",
            ".",
            target,
        ],
        cwd=HERE,
        capture_output=True,
        text=True,
        check=False,
    )
    assert built.returncode == 0, built.stderr
    return target


def pages(site):
    return sorted(
        path
        for path in site.rglob("*.html")
        if not {"_static", "_downloads"} & set(path.relative_to(site).parts)
    )


class Targets(html.parser.HTMLParser):
    def __init__(self, text):
        super().__init__()
        self.wanted, self.anchors = [], set()
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        given = dict(attrs)
        self.anchors |= {given[key] for key in ("id", "name") if given.get(key)}
        self.wanted += [given[key] for key in ("href", "src") if given.get(key)]


def test_no_link_of_the_site_is_dead(site):
    read = {path: Targets(path.read_text(encoding="utf-8")) for path in pages(site)}
    assert len(read) > 20
    dead = []
    for path, targets in read.items():
        for link in targets.wanted:
            if re.match(r"[a-z]+:|//", link):
                continue
            name, _, anchor = unquote(link).partition("#")
            target = (path.parent / name.partition("?")[0]).resolve() if name else path
            if not target.exists() or (anchor and target in read and anchor not in read[target].anchors):
                dead.append(f"{path.relative_to(site)}: {link}")
    assert not dead


def test_the_site_asks_nothing_of_the_network(site):
    asked = re.compile(r'<(?:script|link|img)[^>]+(?:src|href)="(?:https?:)?//[^"]+"')
    found = {path.name: asked.findall(path.read_text(encoding="utf-8")) for path in pages(site)}
    assert not {name: links for name, links in found.items() if links}


def test_every_figure_tells_what_drew_it_at_which_commit(site):
    text = "".join(path.read_text(encoding="utf-8") for path in pages(site))
    figures = re.findall(r'<img ([^>]*src="[^"]*(?:fig-|page-|patterns-|texture-)[^>]*)>', text)
    assert len(figures) > 30
    told = re.compile(r'title="[\w/]+\.py at commit [0-9a-f]{12}"')
    assert not [figure for figure in figures if not told.search(figure)]


def test_every_public_name_is_in_the_reference(site):
    from public_names import public_names

    text = "".join(path.read_text(encoding="utf-8") for path in (site / "docs/reference").glob("*.html"))
    names = [name.split(".")[-1] for name in public_names() if not name.startswith("typing.")]
    unlisted = {name for name in names if not re.search(rf'id="toposeam\.[\w.]*{name}"', text)}
    former = {"generate_motif", "join_volumes", "make_tileable", "plan_path", "synthesize"}
    assert unlisted == former
    assert all(f">ts.{name}</span>" in text for name in former), "the verb's page names its former name"


@pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium here")
def test_a_browser_shows_every_page_on_two_screens_and_searches(site, tmp_path):
    names = [path.relative_to(site).as_posix() for path in pages(site) if path != site / "index.html"]
    (site / "look.html").write_text(LOOK.replace("PAGES", json.dumps(names)), encoding="utf-8")

    found = queue.Queue()

    class Handler(http.server.SimpleHTTPRequestHandler):
        def do_POST(self):
            found.put(json.loads(self.rfile.read(int(self.headers["Content-Length"]))))
            self.send_response(204)
            self.end_headers()

        def log_message(self, *words):
            pass

    with http.server.ThreadingHTTPServer(
        ("127.0.0.1", 0), functools.partial(Handler, directory=site)
    ) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        browser = subprocess.Popen(
            [
                CHROMIUM,
                "--headless",
                "--no-sandbox",
                "--disable-gpu",
                "--disable-dev-shm-usage",  # which is small in containers
                f"--user-data-dir={tmp_path}",
                "--host-resolver-rules=MAP * ~NOTFOUND , EXCLUDE 127.0.0.1",
                "--window-size=1500,1000",
                f"http://127.0.0.1:{server.server_port}/look.html",
            ],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        try:
            *seen, searched = found.get(timeout=500)
        finally:
            browser.terminate()
            browser.wait(120)
            server.shutdown()
    assert {look["page"] for look in seen if look["width"] == 390} == set(names)
    wide = {look["page"] for look in seen if look["width"] == 1400}
    assert wide == {name for name in names if "/reference/" not in name}
    assert not [look for look in seen if look["wide"] > 1 or look["missing"]]
    assert not [look for look in seen if not look["heading"] and look["page"] != "search.html"]
    assert searched["search"]
