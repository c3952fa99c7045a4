/**
 * The live match: hand it what was drawn, and it tells what it is.
 *
 * The server keeps the sketch: each change is one update with what changed, and one stream tells what
 * comes of it. Where the sketch is lost, as when the server begins anew, all strokes make another one.
 * This is all that knows how sketches travel.
 */

import { RequestFailed, type SketchmatchClient } from "@sketchmatch/client";
import type { MatchProgress, MatchResult } from "@sketchmatch/client/v1/match";
import type { SketchQuestion, WatchSketchResponse } from "@sketchmatch/client/v1/sketch_service";
import { YAxis } from "@sketchmatch/client/v1/source";

import type { Pin, Stroke } from "./document";
import { areaOf, boxOf } from "./geometry";
import { matchedWith, thingsOf, type PlaceMap, type Thing } from "./maps";

export interface Progress {
  readonly compiling: boolean;
  readonly seconds: number;
  /** ζ and, where the searcher proves one, its bound, as they developed. */
  readonly curve: readonly {
    readonly seconds: number;
    readonly zeta: number;
    readonly bound: number | undefined;
  }[];
}

/** An answer, and what it is about. */
export interface Answered {
  readonly result: MatchResult;
  readonly question: SketchQuestion | undefined;
  readonly sketched: readonly Thing[];
  /** Ids of the strokes that make up each sketched thing. */
  readonly strokesOf: readonly (readonly string[])[];
  readonly map: PlaceMap;
}

export type SessionEvent =
  | { readonly kind: "running" }
  | { readonly kind: "progress"; readonly progress: Progress }
  | { readonly kind: "answered"; readonly answered: Answered }
  | { readonly kind: "failed"; readonly failure: RequestFailed };

/** What is to be matched. */
interface Wanted {
  readonly strokes: readonly Stroke[];
  readonly pins: readonly Pin[];
  readonly map: PlaceMap;
}

/** Which thing of the sketch is which of the map, by index; null: on no map. */
type Known = readonly (readonly [number, number | null])[];

/** A sketch as the server has it. */
interface Sketch {
  readonly id: string;
  readonly map: PlaceMap;
  readonly began: number;
  readonly watching: AbortController;
  /** The number of the last update. */
  revision: number;
  /** The strokes, in the order of the server, and what they were sent for. */
  strokes: readonly Stroke[];
  sent: Wanted | null;
  pins: Known;
  /** The things of these strokes, once they are told. */
  things: { sketched: readonly Thing[]; strokesOf: readonly (readonly string[])[] } | null;
  curve: Progress["curve"][number][];
  outcome: SessionEvent | null;
}

const RETRY_MS = 1500;
/** A point has 30 bytes, and the server reads a mebibyte at once. */
const POINTS_OF_UPDATE = 15_000;

export class Session {
  readonly #client: SketchmatchClient;
  readonly #tell: (event: SessionEvent) => void;
  #wanted: Wanted | null = null;
  #sketch: Sketch | null = null;
  #sending = false;
  #timer: ReturnType<typeof setTimeout> | undefined;

  constructor(client: SketchmatchClient, tell: (event: SessionEvent) => void) {
    this.#client = client;
    this.#tell = tell;
  }

  /** Match this from now on, and nothing else. */
  update(strokes: readonly Stroke[], pins: readonly Pin[], map: PlaceMap): void {
    this.#wanted = { strokes, pins, map };
    clearTimeout(this.#timer);
    // What changes in one go is one change, and sent before it is painted.
    queueMicrotask(() => void this.#sync());
  }

  /** Match nothing more. */
  cancel(): void {
    this.#wanted = null;
    this.rest();
  }

  /** Keep nothing on the server until `wake`, or the next update. */
  rest(): void {
    clearTimeout(this.#timer);
    const sketch = this.#sketch;
    this.#sketch = null;
    sketch?.watching.abort();
    // One that is not reached ends by itself.
    if (sketch) this.#client.sketches.deleteSketch({ sketchId: sketch.id }).catch(() => undefined);
  }

  wake(): void {
    if (this.#wanted && !this.#sketch) this.#soon(0);
  }

  #soon(ms: number): void {
    clearTimeout(this.#timer);
    this.#timer = setTimeout(() => void this.#sync(), ms);
  }

  /** Bring the server's sketch to what is wanted, update by update. */
  async #sync(): Promise<void> {
    if (this.#sending) return;
    this.#sending = true;
    try {
      for (let wanted = this.#wanted; wanted; wanted = this.#wanted) {
        if (this.#sketch && this.#sketch.map !== wanted.map) this.rest();
        const sketch = this.#sketch;
        if (!sketch) await this.#begin(wanted.map);
        else if (sketch.sent !== wanted) await this.#send(sketch, wanted);
        else if (!areSame(sketch.pins, knownOf(sketch))) await this.#send(sketch, wanted);
        else break;
      }
      if (!this.#wanted) this.rest();
    } catch (thrown) {
      this.#failed(RequestFailed.from(thrown));
    } finally {
      this.#sending = false;
    }
  }

  async #begin(map: PlaceMap): Promise<void> {
    this.#tell({ kind: "running" });
    const match = matchedWith(map);
    const { sketchId } = await this.#client.sketches.createSketch({ match, yAxis: YAxis.DOWN });
    this.#sketch = {
      id: sketchId,
      map,
      began: performance.now(),
      watching: new AbortController(),
      revision: 0,
      strokes: [],
      sent: null,
      pins: [],
      things: null,
      curve: [],
      outcome: null,
    };
    void this.#watch(this.#sketch);
  }

  async #send(sketch: Sketch, wanted: Wanted): Promise<void> {
    const { erased, set } = changesOf(sketch.strokes, wanted.strokes);
    const isDrawn = erased.length > 0 || set.length > 0;
    if (isDrawn) sketch.things = null;
    sketch.sent = wanted;
    // Which thing is which is known anew once the things are; new ones leave the numbers as they are.
    const isAdded = wanted.strokes.length - sketch.strokes.length === set.length;
    const pins = sketch.things ? knownOf(sketch) : isAdded ? sketch.pins : [];
    const isSaid = !areSame(pins, sketch.pins);
    if (!isDrawn && !isSaid) {
      if (sketch.outcome) this.#tell(sketch.outcome);
      return;
    }
    const parts = partsOf(set);
    // What is told before the last of them is overtaken.
    sketch.revision += parts.length;
    sketch.strokes = wanted.strokes;
    sketch.pins = pins;
    sketch.curve = [];
    sketch.outcome = null;
    this.#tell({ kind: "running" });
    for (const [k, part] of parts.entries()) {
      await this.#client.sketches.updateSketch({
        sketchId: sketch.id,
        eraseStrokes: k === 0 ? erased : [],
        setStrokes: part.map((stroke) => ({ strokeId: stroke.id, stroke: travelling(stroke) })),
        ...(isSaid && k === parts.length - 1 ? { pins: { pins: pins.map(pinOf) } } : {}),
      });
    }
  }

  async #watch(sketch: Sketch): Promise<void> {
    try {
      const { signal } = sketch.watching;
      const told = this.#client.sketches.watchSketch({ sketchId: sketch.id }, { signal });
      for await (const each of told) {
        if (this.#sketch !== sketch) return;
        // What is about an earlier revision is overtaken.
        if (Number(each.revision) === sketch.revision) this.#hear(sketch, each.event);
      }
    } catch {
      // Whatever broke the stream, another sketch shows whether the server is there.
    }
    if (this.#sketch !== sketch) return;
    this.#sketch = null;
    this.#soon(performance.now() - sketch.began < RETRY_MS ? RETRY_MS : 0);
  }

  #hear(sketch: Sketch, event: WatchSketchResponse["event"]): void {
    switch (event.case) {
      case "objects": {
        const sketched = thingsOf(event.value.scene);
        sketch.things = { sketched, strokesOf: strokesByThing(sketch.strokes, sketched) };
        if (!areSame(sketch.pins, knownOf(sketch))) this.#soon(0);
        break;
      }
      case "progress":
        this.#tell({ kind: "progress", progress: progressOf(event.value, sketch.curve) });
        break;
      case "result": {
        const { result, question } = event.value;
        if (!result || !sketch.things || !areSame(sketch.pins, knownOf(sketch))) return;
        const answered = { result, question, ...sketch.things, map: sketch.map };
        this.#concluded(sketch, { kind: "answered", answered });
        break;
      }
      case "problem": {
        const { message, reason, field } = event.value;
        if (field.startsWith("pins") && !sketch.things) {
          // New strokes have changed the numbers; without pins the server tells them.
          sketch.things = { sketched: [], strokesOf: [] };
          this.#soon(0);
          return;
        }
        const kind = reason ? "invalid" : "failed";
        const failure = new RequestFailed(message, kind, reason, field, undefined);
        this.#concluded(sketch, { kind: "failed", failure });
      }
    }
  }

  #concluded(sketch: Sketch, outcome: SessionEvent): void {
    sketch.outcome = outcome;
    if (sketch.sent === this.#wanted) this.#tell(outcome);
  }

  #failed(failure: RequestFailed): void {
    const had = this.#sketch !== null;
    this.rest();
    if (!this.#wanted) return;
    if (failure.failure === "gone" && had) {
      this.#soon(0);
      return;
    }
    this.#tell({ kind: "failed", failure });
    if (failure.failure === "away" || failure.failure === "busy") {
      this.#soon(1000 * (failure.retrySeconds ?? 0) || RETRY_MS);
    }
  }
}

/** Return what takes the server's strokes to those that are wanted, in their order. */
function changesOf(
  has: readonly Stroke[],
  wants: readonly Stroke[],
): { erased: string[]; set: Stroke[] } {
  const wanted = new Set(wants.map(({ id }) => id));
  const stay = has.filter(({ id }) => wanted.has(id));
  const moved = stay.findIndex(({ id }, k) => id !== wants[k]?.id);
  // A stroke that comes between others comes after all that are set again behind it.
  const kept = moved < 0 ? stay.length : moved;
  const gone = has.filter(({ id }) => !wanted.has(id));
  return {
    erased: [...gone, ...stay.slice(kept)].map(({ id }) => id),
    set: wants.filter((stroke, k) => k >= kept || stroke !== stay[k]),
  };
}

/** Return strokes in the parts in which they travel: an update is short. */
function partsOf(strokes: readonly Stroke[]): Stroke[][] {
  const parts: Stroke[][] = [[]];
  let points = 0;
  for (const stroke of strokes) {
    if (points && points + stroke.points.length > POINTS_OF_UPDATE) {
      parts.push([]);
      points = 0;
    }
    parts.at(-1)?.push(stroke);
    points += stroke.points.length;
  }
  return parts;
}

/** Return what the person said, by the numbers of the things as they are now. */
function knownOf({ sent, things, pins, map }: Sketch): Known {
  if (!sent || !things) return pins;
  return sent.pins.flatMap(({ strokes, thing }) => {
    const sketched = things.strokesOf.findIndex((ids) => ids.some((id) => strokes.includes(id)));
    const mapped = thing === null ? null : map.things.findIndex(({ id }) => id === thing);
    return sketched < 0 || (mapped !== null && mapped < 0) ? [] : [[sketched, mapped] as const];
  });
}

function areSame(one: Known, other: Known): boolean {
  return JSON.stringify(one) === JSON.stringify(other);
}

function pinOf([sketched, mapped]: Known[number]) {
  const index = (value: number) => ({ kind: { case: "index" as const, value } });
  return {
    sketchObject: index(sketched),
    ...(mapped === null ? {} : { mapObject: index(mapped) }),
  };
}

/** Return a stroke as it travels: raw points, for the ink is for eyes alone. */
function travelling({ points, label }: Stroke) {
  return { points: points.map(([x, y, t]) => ({ x, y, timeSeconds: t })), label };
}

function progressOf(told: MatchProgress, curve: Progress["curve"][number][]): Progress {
  const seconds = Number(told.elapsed?.seconds ?? 0n) + (told.elapsed?.nanos ?? 0) / 1e9;
  if (told.confidence !== undefined) {
    curve.push({ seconds, zeta: told.confidence, bound: told.upperBound });
  }
  return { compiling: told.phase === 5, seconds, curve: [...curve] };
}

/** Return for each thing of a sketch the strokes that made it: those within its box. */
function strokesByThing(strokes: readonly Stroke[], sketched: readonly Thing[]): string[][] {
  const things = sketched.map(({ rings }) => {
    const ring = (rings[0] ?? []).map(([x, y]) => [x, -y] as const);
    return { box: boxOf(ring), area: areaOf(ring) };
  });
  const ids: string[][] = things.map(() => []);
  for (const stroke of strokes) {
    const { x0, y0, x1, y1 } = boxOf(stroke.points);
    let best = -1;
    things.forEach(({ box, area }, k) => {
      const slack = 2 + 0.08 * Math.hypot(box.x1 - box.x0, box.y1 - box.y0);
      const within =
        x0 > box.x0 - slack && y0 > box.y0 - slack && x1 < box.x1 + slack && y1 < box.y1 + slack;
      if (within && (best < 0 || area < (things[best]?.area ?? Infinity))) best = k;
    });
    ids[best]?.push(stroke.id);
  }
  return ids;
}
