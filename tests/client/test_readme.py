import json
import time
from threading import Thread

import pytest

from sketchmatch_client import (
    AccessOptions,
    CallCancelledError,
    Client,
    MatchOptions,
    MatchRow,
    TransferOptions,
    sources,
)
from tests.client.fake_server import EVENTS
from tests.pages import Page

PAGE = Page("clients/python/README.md", __name__)
README = PAGE.text
EXAMPLES = [block.text for block in PAGE.take("python", "import ")]
BUTTON = PAGE.take_one("py", "stop_button")
GEOJSON = PAGE.take_one("py", "to_geojson")


@pytest.mark.parametrize(
    "example", EXAMPLES, ids=["first answer", "pen", "loop", "asyncio", "anyio", "transfer", "tls"]
)
def test_the_examples_run(example, server, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "room.yaml").write_text("image: room.pgm\n", encoding="utf-8")
    for name in ("room.pgm", "sketch.png", "sketch.svg"):
        (tmp_path / name).write_bytes(b"")
    (tmp_path / "ca.pem").write_text("-----BEGIN CERTIFICATE-----\n", encoding="utf-8")
    (tmp_path / "robot-7.token").write_text("robot-7.secret\n", encoding="utf-8")
    exec(example.replace("localhost:50051", server.address), {})


def test_a_button_stops_a_match(server):
    class Button:
        def on_click(self, action):
            Thread(target=self._press, args=[action]).start()

        def _press(self, action):
            while not server.requests:
                time.sleep(0.01)
            action()

    server.events, server.endless = EVENTS[:3], True
    source = sources.image(b"picture")
    with Client(server.address) as client:
        names = {
            **{"client": client, "sketch": source, "room": source, "stop_button": Button()},
            "CallCancelledError": CallCancelledError,
        }
        exec(BUTTON.text, names)
    assert names["match"] is None
    assert server.cancelled.wait(5)


def test_a_match_is_written_as_geojson(server, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    source = sources.image(b"picture")
    with Client(server.address) as client:
        match = client.match(source, source)
    exec(GEOJSON.text, {"match": match})
    written = json.loads((tmp_path / "answer.geojson").read_text(encoding="utf-8"))
    assert written == match.to_geojson()


def test_every_key_of_a_row_is_listed():
    text = README.partition("`match.rows()`")[2].partition("\n\n")[0]
    assert {name for name in MatchRow.__annotations__ if f"`{name}`" not in text} == set()


def test_every_way_into_a_server_is_listed():
    table = README.partition("| argument | variable |")[2].partition("\n\n")[0]
    for name in AccessOptions.__annotations__:
        assert f"`{name}`" in table
        assert f"`SKETCHMATCH_{name.upper()}`" in table


def test_every_option_of_a_transfer_is_listed():
    section = README.partition("\n## Routes and zones\n")[2].partition("\n## ")[0]
    for name in TransferOptions.__annotations__.keys() - MatchOptions.__annotations__.keys():
        assert f"| `{name}` |" in section


def test_every_option_is_listed():
    table = README.partition("| option |")[2].partition("\n\n")[0]
    assert {name for name in MatchOptions.__annotations__ if f"`{name}`" not in table} == set()
