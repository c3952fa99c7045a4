"""``sketchmatch tokens``, and commands that show what it made."""

import json
import stat

import pytest

from sketchmatch.examples import LIVING_ROOM_MAP, LIVING_ROOM_SKETCH
from sketchmatch.server.tokens import new_token, read_tokens
from tests.certificates import Authority
from tests.processes import server, sketchmatch


@pytest.fixture(autouse=True)
def _nothing_around(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "home"))


def said(done, code=2):
    assert (done.returncode, done.stdout) == (code, "")
    (line,) = done.stderr.splitlines()
    return line


def test_a_token_is_printed_once_and_only_its_hash_is_kept(command_line, tmp_path):
    done = command_line("tokens", "add", "robot-7", "--file", "tokens")
    assert done.returncode == 0
    token = done.stdout.removesuffix("\n")
    file = tmp_path / "tokens"
    assert stat.S_IMODE(file.stat().st_mode) == 0o600
    secret = token.removeprefix("robot-7.")
    assert len(secret) >= 43
    assert secret not in file.read_text() + done.stderr
    assert read_tokens(file).caller_of(token) == "robot-7"
    assert list(tmp_path.iterdir()) == [file]


def test_equal_tokens_have_different_hashes():
    first, second = (new_token("robot-7") for _ in range(2))
    assert first[0] != second[0]
    assert first[1].salt != second[1].salt


def test_tokens_are_listed_rotated_and_removed_by_name(command_line, tmp_path):
    file = tmp_path / "tokens"
    file.write_text("# ours\n")
    file.chmod(0o640)
    old, pad, new = (
        command_line("tokens", "add", name, "--file", file).stdout.strip()
        for name in ("robot-7", "pad", "robot-7")
    )
    assert command_line("tokens", "list", "--file", file).stdout == "pad\t1\nrobot-7\t2\n"
    known = read_tokens(file)
    assert [known.caller_of(token) for token in (old, pad, new)] == ["robot-7", "pad", "robot-7"]
    done = command_line("tokens", "remove", "robot-7", "--old", "--file", file)
    assert done.stderr == f"sketchmatch: removed 1 token of robot-7 from {file}\n"
    known = read_tokens(file)
    assert [known.caller_of(token) for token in (old, pad, new)] == ["", "pad", "robot-7"]
    command_line("tokens", "remove", "robot-7", "--file", file)
    assert command_line("tokens", "list", "--file", file).stdout == "pad\t1\n"
    assert file.read_text().startswith("# ours\npad:sha256:")
    assert stat.S_IMODE(file.stat().st_mode) == 0o640


def test_the_configuration_names_the_file(command_line, tmp_path):
    (tmp_path / "sketchmatch.toml").write_text('[server]\ntokens = "mine"\n')
    assert command_line("tokens", "add", "robot-7").returncode == 0
    assert command_line("tokens", "list").stdout == "robot-7\t1\n"
    assert (tmp_path / "mine").exists()


def test_what_cannot_be_done_is_said_in_a_line(command_line, tmp_path):
    file = tmp_path / "tokens"
    assert said(command_line("tokens", "add", "a b", "--file", file)) == (
        "sketchmatch: 'a b' cannot be the name of a caller; use up to 64 letters, digits and . _ @ "
        "- as in robot-7"
    )
    assert "--file is not given, and the configuration has no" in said(
        command_line("tokens", "list")
    )
    assert f"{file} cannot be read (no such file" in said(
        command_line("tokens", "list", "--file", file)
    )
    assert "cannot be written (no such file or directory)" in said(
        command_line("tokens", "add", "a", "--file", tmp_path / "away" / "tokens")
    )
    file.write_text("robot-7.secret\n")
    line = said(command_line("tokens", "add", "a", "--file", file))
    assert line.startswith(f"sketchmatch: {file}, line 1, is not of the form NAME:sha256:SALT")
    assert "secret" not in line
    file.write_text("")
    assert "'a' has no token in" in said(command_line("tokens", "remove", "a", "--file", file))
    (tmp_path / ".tokens.new").write_text("")
    assert f"{file} is being changed by another command" in said(
        command_line("tokens", "add", "a", "--file", file)
    )


@pytest.mark.slow
def test_commands_show_tokens_and_certificates(command_line, monkeypatch, tmp_path):
    ours = Authority(tmp_path, "ours")
    pair, client = ours.issue("localhost"), ours.issue("robot-7")
    (tmp_path / "token").write_text(
        command_line("tokens", "add", "robot-7", "--file", "tokens").stdout
    )
    options = ["--tls-certificate", pair.certificate, "--tls-key", pair.key]
    options += ["--tls-client-ca", ours.certificate, "--tokens", tmp_path / "tokens"]
    way_in = {
        "--root-certificates": ours.certificate,
        "--certificate": client.certificate,
        "--key": client.key,
        "--token-file": tmp_path / "token",
    }
    with server(*map(str, options)) as running:
        at = ["--server", running.address.replace("127.0.0.1", "localhost")]
        shown = [text for option in way_in.items() for text in option]
        done = command_line("match", LIVING_ROOM_SKETCH, LIVING_ROOM_MAP, "--json", *at, *shown)
        assert json.loads(done.stdout)["objectMatches"]
        assert command_line("segment", LIVING_ROOM_SKETCH, *at, *shown).returncode == 0
        line = said(command_line("plugins", "list", *at, *shown[:-2]), 6)
        assert line.startswith("sketchmatch: this server requires a token, but the call has none")
        for option, value in way_in.items():
            variable = "SKETCHMATCH_" + option.removeprefix("--").replace("-", "_").upper()
            monkeypatch.setenv(variable, str(value))
        assert command_line("plugins", "show", "easm", *at).returncode == 0


def test_ways_into_a_server_are_of_no_use_without_one(command_line):
    line = said(command_line("plugins", "list", "--token-file", "token"))
    assert line == (
        "sketchmatch: --token-file needs a server, but none is given; add --server, or leave it out"
    )


@pytest.mark.slow
def test_the_demo_needs_no_token_whatever_the_configuration_says(tmp_path):
    (tmp_path / "sketchmatch.toml").write_text(
        '[server]\ntokens = "away"\ntls_certificate = "away"\ntls_key = "away"\n'
    )
    done = sketchmatch("demo", cwd=tmp_path)
    assert done.returncode == 0, done.stderr


def test_certificate_and_key_go_together(command_line, tmp_path):
    line = said(command_line("serve", "--tls-key", tmp_path / "a"))
    assert line == (
        "sketchmatch: server.tls_key is set without server.tls_certificate; "
        "give --tls-certificate and --tls-key together"
    )
