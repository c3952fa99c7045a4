"""The TypeScript client, as its README shows it, in Node.js against a real server."""

import re
import shutil
import subprocess

import pytest

from tests.tools import require
from tests.web import CLIENTS, serving_pad

README = (CLIENTS / "typescript" / "README.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def url():
    with serving_pad() as (_, address):
        yield address


def node(code):
    require(shutil.which("node"), "node")
    return subprocess.run(
        ["node", "--input-type=module", "--eval", code],
        cwd=CLIENTS / "web",
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )


@pytest.mark.slow
def test_the_first_answer_of_the_readme_is_what_it_says(url):
    ((code, printed),) = re.findall(r"^```js\n(.*?)^```\n\n^```\n(.*?)^```", README, re.S | re.M)
    done = node(code.replace("http://127.0.0.1:8080", url.rstrip("/")))
    assert (done.stdout, done.stderr) == (printed, "")


@pytest.mark.slow
def test_errors_say_what_to_do_and_where(url):
    done = node(f"""
        import {{ SketchmatchClient, sources }} from "@sketchmatch/client";
        const client = new SketchmatchClient("{url.rstrip("/")}");
        const there = sources.strokes([{{ points: [[0, 0], [1, 1]] }}]);
        const told = await client.match(there, there).catch((error) => error);
        console.log(told.name, told.failure, told.reason, told.field);
        const nobody = new SketchmatchClient("http://127.0.0.1:9");
        console.log((await nobody.info().catch((error) => error)).failure);
        const stop = new AbortController();
        const call = client.match(there, there, {{}}, {{}}, stop.signal).catch((error) => error);
        stop.abort();
        console.log((await call).failure);
    """)
    assert done.stderr == ""
    first, away, cancelled = done.stdout.splitlines()
    assert re.match(r"RequestFailed invalid [A-Z_]+ sketch", first)
    assert (away, cancelled) == ("away", "cancelled")
