/** What the page shows, and what changes it. */

import { RequestFailed, SketchmatchClient } from "@sketchmatch/client";
import type { AlternativeMap, ObjectMatch } from "@sketchmatch/client/v1/match";
import { batch, computed, effect, signal } from "@preact/signals";

import { similarity } from "./carry";
import { change, drawing, EMPTY, pinStrokes, replace, type Stroke } from "./document";
import { ink, inkOf, packed, parseStrokes, unpacked } from "./files";
import { isInside, type Xy } from "./geometry";
import { keep, restored } from "./keep";
import {
  foundOtherwise,
  isPlace,
  openMap,
  openOutlines,
  openPlace,
  type Place,
  type PlaceMap,
  sampleSketch,
  type Tuned,
} from "./maps";
import { type Answered, type Progress, Session } from "./session";
import { texts } from "./texts";

export type Tool = "pen" | "route" | "eraser" | "move" | "name";
export type Theme = "auto" | "light" | "dark";
export type Side = "sketch" | "map";

/** A thing of one side, by its index there. */
export interface Lit {
  readonly side: Side;
  readonly index: number;
}

/** One line of the answer. */
export interface Pair {
  readonly sketch: number;
  readonly map: number;
  readonly probability: number | undefined;
  readonly pinned: boolean;
}

export const tool = signal<Tool>("pen");
export const fingerDraws = signal(true);
export const place = signal<PlaceMap | null>(null);
export const answered = signal<Answered | null>(null);
export const running = signal(false);
export const progress = signal<Progress | null>(null);
export const cancelled = signal(false);
/** Why there is no answer; null if nothing is wrong. */
export const trouble = signal<RequestFailed | null>(null);
/** A sentence about something else than the match, until it is closed. */
export const notice = signal("");
export const lit = signal<Lit | null>(null);
/** The sketched thing that a tap on the map is about. */
export const asking = signal<number | null>(null);
/** Which reading is shown: 0 for the best, k for alternative k − 1. */
export const reading = signal(0);
export const naming = signal<readonly string[] | null>(null);
export const theme = signal<Theme>((localStorage.getItem("theme") as Theme | null) ?? "auto");
export const dark = signal(false);
/** Grows each time the sheets are to be shown whole. */
export const refit = signal(0);

export const client = new SketchmatchClient(location.origin, {
  token: () => sessionStorage.getItem("token") ?? "",
});

/** Milliseconds from the pen up to the answer on the screen, the latest last. */
export const latencies: number[] = [];
let asked = 0;

const session = new Session(client, (event) =>
  batch(() => {
    switch (event.kind) {
      case "running":
        running.value = true;
        progress.value = null;
        break;
      case "progress":
        progress.value = event.progress;
        break;
      case "answered":
        running.value = false;
        trouble.value = null;
        reading.value = 0;
        answered.value = event.answered;
        requestAnimationFrame(() => latencies.push(performance.now() - asked));
        break;
      case "failed":
        running.value = false;
        trouble.value = event.failure;
        if (event.failure.failure === "invalid") answered.value = null;
    }
  }),
);

export const readings = computed(() => 1 + (answered.value?.result.alternatives.length ?? 0));

/** The lines of the reading that is shown, in the order of the sketch. */
export const pairs = computed<readonly Pair[]>(() => {
  const found = answered.value;
  if (!found) return [];
  const other: AlternativeMap | undefined = found.result.alternatives[reading.value - 1];
  const lines: readonly ObjectMatch[] = (other ?? found.result).objectMatches;
  return lines.map((line) => ({
    sketch: line.sketchObject,
    map: line.mapObject,
    probability: line.probability,
    pinned: pinOf(found, line.sketchObject) === found.map.things[line.mapObject]?.id,
  }));
});

export const elsewhere = computed(
  () => (answered.value?.result.placeProbability ?? 1) < 0.5 && reading.value === 0,
);

/** Sketched and mapped things without partner in the reading that is shown. */
export const alone = computed(() => {
  const found = answered.value;
  const drawn = new Set(pairs.value.map(({ sketch }) => sketch));
  const mapped = new Set(pairs.value.map(({ map }) => map));
  return {
    sketch: (found?.sketched ?? []).map((_, k) => k).filter((k) => !drawn.has(k)),
    map: (found?.map.things ?? []).map((_, k) => k).filter((k) => !mapped.has(k)),
  };
});

/** What to ask where several readings fit: a sketched thing, and what it may be. */
export const question = computed(() => {
  const found = answered.value;
  const ambiguity = found?.result.ambiguity;
  const sketch = ambiguity?.decidingSketchObjects[0];
  if (!found || !ambiguity || sketch === undefined) return null;
  const maps = [
    found.result.objectMatches,
    ...ambiguity.alternatives.map((k) => found.result.alternatives[k]?.objectMatches ?? []),
  ];
  const candidates = new Set(
    maps.flatMap((lines) =>
      lines.filter((line) => line.sketchObject === sketch).map((line) => line.mapObject),
    ),
  );
  return { sketch, maps: ambiguity.maps, candidates: [...candidates] };
});

/** The route as the robot would drive it; null where there is none, or nothing to carry it by. */
export const carried = computed<readonly Xy[] | null>(() => {
  const route = drawing.value.strokes.find((stroke) => stroke.route);
  const found = answered.value;
  if (!route || !found || elsewhere.value) return null;
  const [from, to]: [Xy[], Xy[]] = [[], []];
  for (const { sketch, map } of pairs.value) {
    const [drawn, mapped] = [found.sketched[sketch], found.map.things[map]];
    if (drawn && mapped) {
      from.push(drawn.centroid);
      to.push(mapped.centroid);
    }
  }
  const carry = similarity(from, to);
  return carry && route.points.map(([x, y]) => carry([x, -y]));
});

/** Return the pair of a thing, if it has one. */
export function pairOf(thing: Lit | null): Pair | undefined {
  if (!thing) return undefined;
  return pairs.value.find((pair) => pair[thing.side] === thing.index);
}

export function isLit(side: Side, index: number): boolean {
  const thing = lit.value;
  if (!thing) return false;
  if (thing.side === side) return thing.index === index;
  return pairOf(thing)?.[side] === index;
}

export function sketchName(index: number): string {
  return answered.value?.sketched[index]?.label || texts.value.thing(index + 1);
}

export function mapName(index: number): string {
  return place.value?.things[index]?.label || texts.value.thing(index + 1);
}

/** Say that a sketched thing is that thing of the map; null: none; undefined: say nothing of it. */
export function pin(sketch: number, map: number | null | undefined): void {
  const strokes = answered.value?.strokesOf[sketch] ?? [];
  const thing = map == null ? map : (place.value?.things[map]?.id ?? undefined);
  asking.value = null;
  if (strokes.length) pinStrokes(strokes, thing);
}

/** Return what the person said of a sketched thing; undefined if nothing. */
export function pinOf(found: Answered, sketch: number): string | null | undefined {
  const strokes = found.strokesOf[sketch] ?? [];
  return drawing.value.pins.find((one) => one.strokes.some((id) => strokes.includes(id)))?.thing;
}

/** Return the thing at a point of the paper; null where there is none. */
export function thingAt([x, y]: Xy): number | null {
  const things = answered.value?.sketched ?? [];
  const found = things.findIndex(({ rings }) => rings[0] && isInside(rings[0], [x, -y]));
  return found < 0 ? null : found;
}

export function cancel(): void {
  session.cancel();
  running.value = false;
  cancelled.value = true;
}

export function matchNow(): void {
  const map = place.peek();
  const now = drawing.peek();
  asked = performance.now();
  cancelled.value = false;
  trouble.value = null;
  asking.value = null;
  if (map && now.strokes.some((stroke) => !stroke.route)) session.update(now, map);
  else {
    session.cancel();
    running.value = false;
    answered.value = null;
  }
}

/** Show another map; what was said of the former one holds no longer. */
function show(map: PlaceMap): void {
  batch(() => {
    answered.value = null;
    lit.value = null;
    place.value = map;
  });
}

export function newSheet(): void {
  change((now) => (now.strokes.length ? EMPTY : now));
}

export async function choosePlace(name: Place): Promise<void> {
  await telling(async () => {
    show(await openPlace(client, name));
    change((now) => (now.pins.length ? { ...now, pins: [] } : now));
    refit.value++;
  });
}

export async function bringMap(files: readonly File[]): Promise<void> {
  await telling(async () => {
    const map = await openMap(client, files, texts.peek().pictureLacking);
    show(map);
    change((now) => (now.pins.length ? { ...now, pins: [] } : now));
    notice.value = map.warnings.join(" ");
    refit.value++;
  });
}

export async function bringSketch(file: File): Promise<void> {
  await telling(async () => {
    let strokes: Stroke[] | null = null;
    if (file.name.toLowerCase().endsWith(".json")) strokes = parseStrokes(await file.text());
    if (!strokes) {
      const { outlines, route } = await openOutlines(client, file);
      strokes = inkOf(outlines, route);
    }
    const brought = strokes;
    change(() => ({ strokes: brought, pins: [] }));
    refit.value++;
  });
}

/** Look for the things of the map again, with other parameters. */
export async function findOtherwise(parameters: Tuned): Promise<void> {
  const map = place.peek();
  if (!map) return;
  await telling(async () => {
    const other = await foundOtherwise(client, map, parameters);
    if (place.peek() !== map) return; // another one was chosen meanwhile
    show(other);
    change((now) => (now.pins.length ? { ...now, pins: [] } : now));
  });
}

/** Take a thing off the map, as if the robot had not seen it. */
export function leaveOut(index: number): void {
  const map = place.value;
  if (map) show({ ...map, things: map.things.filter((_, k) => k !== index) });
}

/** Draw the place as somebody drew it, stroke by stroke. */
export async function showMe(): Promise<void> {
  const map = place.peek();
  if (!map || !isPlace(map.place)) return;
  await telling(async () => {
    const strokes = parseStrokes(await sampleSketch(map.place as Place)) ?? [];
    refit.value++;
    const still = matchMedia("(prefers-reduced-motion: reduce)").matches;
    for (const { points } of strokes) {
      change((now) => ({ ...now, strokes: [...now.strokes, ink(points)] }));
      if (!still) await new Promise((later) => setTimeout(later, 260));
    }
    refit.value++;
  });
}

export async function link(): Promise<string> {
  const shared = { place: place.peek()?.place ?? "", drawing: drawing.peek() };
  return `${location.origin}${location.pathname}#${await packed(shared)}`;
}

export function showToken(token: string): void {
  sessionStorage.setItem("token", token.trim());
  void (place.peek() ? matchNow() : start());
}

/** Show what was there before, or what the link says, and keep it from now on. */
export async function start(): Promise<void> {
  const linked = location.hash.length > 1 ? await unpacked(location.hash.slice(1)) : null;
  if (linked) history.replaceState(null, "", location.pathname);
  const kept = linked ? undefined : await restored();
  replace(linked?.drawing ?? kept?.drawing ?? EMPTY);
  const map = linked?.place || kept?.map || "living-room";
  await mapped(map);
  effect(() => {
    const [now, here] = [drawing.value, place.value];
    if (here) void keep({ drawing: now, map: here.place || { ...here, found: null } });
  });
}

async function mapped(map: string | PlaceMap): Promise<void> {
  if (typeof map !== "string") {
    show(map);
    return;
  }
  for (;;) {
    try {
      show(await openPlace(client, isPlace(map) ? map : "living-room"));
      refit.value++;
      return;
    } catch (thrown) {
      trouble.value = RequestFailed.from(thrown);
      if (trouble.value.failure !== "away" && trouble.value.failure !== "busy") return;
      await new Promise((later) => setTimeout(later, 1500));
    }
  }
}

async function telling(work: () => Promise<void>): Promise<void> {
  notice.value = "";
  try {
    await work();
  } catch (thrown) {
    const failed = RequestFailed.from(thrown);
    if (failed.failure === "away") trouble.value = failed;
    else notice.value = failed.message;
  }
}

effect(() => {
  void [drawing.value, place.value];
  matchNow();
});

const prefersDark = matchMedia("(prefers-color-scheme: dark)");
const paint = () => {
  dark.value = theme.value === "dark" || (theme.value === "auto" && prefersDark.matches);
  document.documentElement.dataset["theme"] = dark.value ? "dark" : "light";
};
prefersDark.addEventListener("change", paint);
effect(paint);

export function choose(shown: Theme): void {
  localStorage.setItem("theme", shown);
  theme.value = shown;
}
