"""What people write with the public names: ``mypy --strict`` must find nothing to say."""

import asyncio
import math
import threading
from contextlib import aclosing, closing
from pathlib import Path

import numpy as np

import sketchmatch
import sketchmatch_client
from sketchmatch import (
    Comparison,
    DirectionalRelation,
    Engine,
    InvalidInputError,
    MatchResult,
    Scene,
    SketchmatchError,
    compare,
    directional_relation,
    force_histogram,
    label_force_histograms,
    match,
    read_scene,
)
from sketchmatch_client import (
    AsyncClient,
    CallCancelledError,
    Client,
    InvalidRequestError,
    Match,
    MatchCall,
    MatchOptions,
    match_request,
    segment_request,
    sources,
    summary,
)


def told(progress: sketchmatch.Progress) -> None:
    if progress.confidence is not None:
        print(f"{progress.confidence:.3f}")


def here() -> MatchResult:
    sketch = Scene.from_polygons([np.zeros((4, 2)), [[0, 0], [1, 0], [1, 1]]], labels=[0, "desk"])
    room: Scene = read_scene("office.yaml", segmenter="rooms", params={"min_area": 4})
    result = match(
        sketch,
        Path("office.yaml"),
        sketch_segmenter=None,
        map_segmenter="rooms",
        params={"map_segmenter": {"min_area": 4.0}, "searcher": {"population": 400}},
        weights=(1, 1, 0.5),
        time_budget=2.0,
        on_progress=told,
    )
    found: Comparison = compare(sketch, room, similarity="overlap")
    for entry in found.most_similar(limit=5):
        print(entry.sketch_pair[0], entry.similarity)
    relation: DirectionalRelation = directional_relation(
        force_histogram(sketch.objects[0], [[0, 0]])
    )
    print(relation.phrase, result.object_map[0], result.matches[0].margin, result.outcome)
    print(label_force_histograms([[1, 0, 2]]).shape, found.table.similarity.max())
    return result


def asked() -> Match | None:
    pen = sources.strokes([[(0, 0), (1, 0), (1, 1)]], labels=["sofa"], y_axis="down")
    options: MatchOptions = {"searcher": "easm", "seed": 7}

    def show(progress: sketchmatch_client.Progress) -> None:
        bound = progress.upper_bound
        print(progress.object_map, None if bound is None else round(bound, 2), progress.phase)

    with Client("localhost:50051", timeout=math.inf) as client:
        client.wait_until_serving(timeout=60)
        call: MatchCall = client.events(pen, pen, **options)
        try:
            threading.Timer(3.0, call.cancel).start()
            with call:
                for event in call:
                    print(event.WhichOneof("event"), summary(event))
        except CallCancelledError as error:
            print(error.reason)
        with closing(client.events(pen, pen)) as events:
            print(next(events).accepted.seed)
        answer = client.match(pen, pen, on_progress=show, weights=(1, 1, 1), allow_unmatched=True)
        for line in answer.result.object_matches:
            print(line.sketch_label, line.confidence)
        if answer.probability is not None:
            print(answer.probability > 0.5, answer.outcome)
        print(summary(client.segment(pen, params={"min_size": 0.3})), client.algorithms())
        print(match_request(pen, pen, **options).seed, segment_request(pen).profile)
        return answer


async def waited() -> None:
    source = sources.image(b"")
    async with AsyncClient("localhost:50051") as client:
        async with aclosing(client.events(source, source, seed=1)) as events:
            async for event in events:
                print(event.progress.confidence)
        answer: Match = await client.match(source, source, on_progress=print)
        print(answer.object_map, (await client.server_info()).version)


if __name__ == "__main__":
    try:
        here()
        asked()
        asyncio.run(waited())
    except (InvalidInputError, InvalidRequestError) as error:
        print(error.reason, error.field)
    except SketchmatchError as error:
        print(error)
    print(Engine)
