import re

import pytest

from tests.tools import ROOT

README = (ROOT / "clients" / "python" / "README.md").read_text(encoding="utf-8")
EXAMPLES = re.findall(r"```python\n(.*?)```", README, re.DOTALL)


@pytest.mark.parametrize("example", EXAMPLES, ids=["one call", "asyncio", "tls"])
def test_the_examples_run(example, server, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "room.yaml").write_text("image: room.pgm\n", encoding="utf-8")
    for name in ("room.pgm", "sketch.png", "ca.pem"):
        (tmp_path / name).write_bytes(b"")
    exec(example.replace("localhost:50051", server.address), {})
