/**
 * The live match: hand it what was drawn, and it tells what it is.
 *
 * Each change ends the match under way and begins one with all strokes. This is all that knows how
 * sketches travel; a service that keeps sketches on the server takes its place here.
 */

import { RequestFailed, sources, type Answer, type SketchmatchClient } from "@sketchmatch/client";
import type { MatchProgress } from "@sketchmatch/client/v1/match";
import type { Scene } from "@sketchmatch/client/v1/scene";

import type { Drawing, Stroke } from "./document";
import { areaOf, boxOf } from "./geometry";
import { thingsOf, type PlaceMap, type Thing } from "./maps";

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
export interface Answered extends Answer {
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

const RETRY_MS = 1500;

export class Session {
  readonly #client: SketchmatchClient;
  readonly #tell: (event: SessionEvent) => void;
  #running: AbortController | null = null;
  #timer: ReturnType<typeof setTimeout> | undefined;
  #known: { strokes: readonly Stroke[]; strokesOf: readonly (readonly string[])[] } | null = null;

  constructor(client: SketchmatchClient, tell: (event: SessionEvent) => void) {
    this.#client = client;
    this.#tell = tell;
  }

  /** Match this from now on, and nothing else. */
  update(drawing: Drawing, map: PlaceMap): void {
    this.cancel();
    // What changes in one go is one change.
    this.#timer = setTimeout(() => void this.#match(drawing, map), 0);
  }

  /** Match nothing more. */
  cancel(): void {
    clearTimeout(this.#timer);
    this.#running?.abort();
    this.#running = null;
  }

  async #match(drawing: Drawing, map: PlaceMap): Promise<void> {
    const running = (this.#running = new AbortController());
    const { signal } = running;
    const current = () => this.#running === running;
    this.#tell({ kind: "running" });
    try {
      const sketch = sources.strokes(drawing.strokes.map(sent));
      const pins = await this.#pins(drawing, map, signal);
      const curve: Progress["curve"][number][] = [];
      const answer = await this.#client.match(
        sketch,
        sources.polygons(map.things),
        { pins },
        {
          progress: (progress) => {
            if (current()) this.#tell({ kind: "progress", progress: progressOf(progress, curve) });
          },
        },
        signal,
      );
      if (!current()) return;
      const sketched = thingsOf(answer.scenes.sketch);
      const strokesOf = strokesByThing(drawing.strokes, answer.scenes.sketch);
      this.#known = { strokes: drawing.strokes, strokesOf };
      this.#running = null;
      this.#tell({ kind: "answered", answered: { ...answer, sketched, strokesOf, map } });
    } catch (thrown) {
      if (!current()) return;
      this.#running = null;
      const failure = RequestFailed.from(thrown);
      this.#tell({ kind: "failed", failure });
      if (failure.failure === "away" || failure.failure === "busy") {
        const wait = 1000 * (failure.retrySeconds ?? 0) || RETRY_MS;
        this.#timer = setTimeout(() => void this.#match(drawing, map), wait);
      }
    }
  }

  /** Return the pins by index; which thing is which is asked where it may have changed. */
  async #pins(drawing: Drawing, map: PlaceMap, signal: AbortSignal) {
    if (!drawing.pins.length) return [];
    if (this.#known?.strokes !== drawing.strokes) {
      const { scene } = await this.#client.segment(
        sources.strokes(drawing.strokes.map(sent)),
        {},
        signal,
      );
      this.#known = {
        strokes: drawing.strokes,
        strokesOf: strokesByThing(drawing.strokes, scene),
      };
    }
    const { strokesOf } = this.#known;
    const index = (value: number) => ({ kind: { case: "index" as const, value } });
    return drawing.pins.flatMap(({ strokes, thing }) => {
      const sketched = strokesOf.findIndex((ids) => ids.some((id) => strokes.includes(id)));
      const mapped = map.things.findIndex(({ id }) => id === thing);
      if (sketched < 0 || (thing !== null && mapped < 0)) return [];
      return [
        {
          sketchObject: index(sketched),
          ...(thing === null ? {} : { mapObject: index(mapped) }),
        },
      ];
    });
  }
}

/** Return a stroke as it travels: raw points, for the ink is for eyes alone. */
function sent({ points, label, route }: Stroke) {
  return { points: points.map(([x, y, t]) => [x, y, t]), label: route ? "route" : label };
}

function progressOf(told: MatchProgress, curve: Progress["curve"][number][]): Progress {
  const seconds = Number(told.elapsed?.seconds ?? 0n) + (told.elapsed?.nanos ?? 0) / 1e9;
  if (told.confidence !== undefined) {
    curve.push({ seconds, zeta: told.confidence, bound: told.upperBound });
  }
  return { compiling: told.phase === 5, seconds, curve: [...curve] };
}

/** Return for each thing of a sketch the strokes that made it: those within its box. */
export function strokesByThing(strokes: readonly Stroke[], scene: Scene | undefined): string[][] {
  const things = thingsOf(scene).map(({ rings }) => {
    const ring = (rings[0] ?? []).map(([x, y]) => [x, -y] as const);
    return { box: boxOf(ring), area: areaOf(ring) };
  });
  const ids: string[][] = things.map(() => []);
  for (const stroke of strokes) {
    if (stroke.route) continue;
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
