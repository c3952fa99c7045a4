"""Whatever a plugin does, the caller learns whose fault it is, and the server goes on."""

import grpc
import pytest

from sketchmatch_client import Client, ServerFailedError, sources
from tests.server.harness import hosting, scene, serving, serving_setup
from tests.server.misbehaving import BROKEN, EmptySegmenter, RaisingSegmenter, ScribblingHistogram


@pytest.fixture(scope="module")
def client():
    with serving(*BROKEN) as host, Client(host.address) as client:
        yield client


@pytest.mark.slow
@pytest.mark.parametrize("plugin", BROKEN, ids=lambda plugin: plugin.__name__)
def test_a_broken_plugin_is_named_with_its_distribution_and_the_server_goes_on(
    client, plugin, caplog
):
    stage, words = BROKEN[plugin]
    kind = stage.removeprefix("map_")
    # `auto` leaves no objects out, so that the judge is asked whether it does.
    chosen = {"searcher": "auto", stage: plugin.name}
    with pytest.raises(ServerFailedError, match=words) as raised:
        client.match(scene(4), scene(4), **chosen, time_budget=1.0)
    sentence = str(raised.value)
    assert raised.value.reason == "PLUGIN_FAILED"
    assert raised.value.__cause__.code() is grpc.StatusCode.INTERNAL
    assert sentence.startswith(f"{kind} {plugin.name} of acme-plugins 1.2 failed (")
    assert sentence.endswith("; report it to its author, or choose another")
    assert "\n" not in sentence
    assert plugin.name in caplog.text, "the operator's log says so as well"
    assert client.match(scene(4), scene(4)).object_map == {k: k for k in range(4)}


def test_what_a_plugin_wrote_into_its_input_is_given_to_nobody_else(tmp_path):
    setup = serving_setup(ScribblingHistogram)
    with hosting(setup, store=tmp_path) as host, Client(host.address) as client:
        name = client.put_scene(scene(5)).stored_scene.name
        sides = [(scene(5), scene(5)), (scene(5), sources.stored_scene(name))]
        for sketch, map_ in sides:
            with pytest.raises(ServerFailedError, match="it changed its input"):
                client.match(sketch, map_, histogram=ScribblingHistogram.name)
            for again in sides:
                match = client.match(*again, searcher="exact", judge="confidence")
                assert match.result.omap_confidence == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize("plugin", [RaisingSegmenter, EmptySegmenter], ids=["raises", "rubbish"])
def test_a_broken_segmenter_is_named_by_segment_as_well(client, plugin):
    with pytest.raises(ServerFailedError, match=f"segmenter {plugin.name} of acme-plugins 1.2"):
        client.segment(scene(4), segmenter=plugin.name)
    assert len(client.segment(scene(4)).scene.objects) == 4
