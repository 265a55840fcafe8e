"""``toposeam stitch --report``: a page with everything in it, in a real browser where there is one."""

import re
import shutil
import subprocess

import pytest
from three_pictures import AT, FILES

from stitching import names
from toposeam_cli.stitching import inputs as placing

BROWSER = next((found for name in ("chromium", "google-chrome") if (found := shutil.which(name))), None)


@pytest.fixture(params=[False, True], ids=["in memory", "by windows"])
def page(three, toposeam, request, monkeypatch):
    if request.param:
        monkeypatch.setattr(placing, "STORED_PIXELS", 0)
        monkeypatch.setattr("toposeam_cli.jobs.crew.processes_of", lambda _: 1)
    ran = toposeam("stitch", *FILES, *AT, "-o", "out.tif", "--crop", "inside", "--report", "seams.html")
    assert ran.code == 0, ran
    assert names(three) == [*FILES, "out.tif", "seams.html"]
    return three / "seams.html"


def test_the_page_lists_all_seams_and_pictures_without_links(page):
    text = page.read_text()
    rows = re.findall(r'<tr data-seam="(\d)"><td>(.*?)</td><td>(.*?)</td>.*?<td>([^<]*)</td></tr>', text)
    assert [row[1] for row in rows] == ["a.png : b.png", "a.png : c.png", "b.png : c.png"]
    assert all(float(cost) > 0 and float(correlation) > 0.5 for _, _, cost, correlation in rows)
    assert re.findall(r"<tr><td>(.\.png)</td><td>(\d)</td>", text) == [
        ("a.png", "0"),
        ("b.png", "1"),
        ("c.png", "2"),
    ]
    shares = [float(share) for share in re.findall(r"<td>([\d.]+)%</td></tr>", text)]
    assert sum(shares) == pytest.approx(100, abs=0.2)
    assert len(re.findall(r'<path data-seam="\d" d="M[\d.]+ [\d.]+ L', text)) == 3
    assert "{{" not in text
    for word in ("http:", "https:", "//cdn", "@import"):
        assert word not in text


@pytest.mark.medium
@pytest.mark.skipif(BROWSER is None, reason="there is no Chromium")
def test_the_slider_and_the_rows_work_in_a_browser(page, tmp_path):
    moving = tmp_path / "moving.html"
    script = """<script>
window.onload = () => {
  slider.value = 25; slider.oninput();
  document.querySelectorAll("#seams tbody tr")[1].onclick();
  const lines = document.getElementById("lines");
  lines.checked = false; lines.dispatchEvent(new Event("change"));
  const told = document.createElement("pre");
  told.textContent = [before.naturalWidth, before.naturalHeight, after.naturalWidth,
    getComputedStyle(after).clipPath, document.querySelectorAll("path.chosen").length,
    document.querySelector("svg").style.display, slider.parentNode.offsetHeight].join(";");
  document.body.append(told);
};</script></body>"""
    moving.write_text(page.read_text().replace("</body>", script))
    command = [BROWSER, "--headless", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage"]
    command += [f"--user-data-dir={tmp_path / 'profile'}", "--virtual-time-budget=3000", "--dump-dom"]
    ran = subprocess.run(
        [*command, f"file://{moving}"], capture_output=True, text=True, timeout=600, check=True
    )
    (told,) = re.findall(r"<pre>(.*?)</pre>", ran.stdout)
    width, height, wide, clip, chosen, display, label = told.split(";")
    assert int(width) == int(wide) > 40
    assert int(height) > 40
    assert clip.replace("0px", "0") == "inset(0 75% 0 0)"
    assert (chosen, display) == ("1", "none")
    assert int(label) < 40, "the slider and what its ends mean are in one line"


def test_a_report_is_a_page(three, toposeam):
    toposeam("stitch", *FILES, *AT, "-o", "out.png", "--report", "seams.png").fails("not supported")
