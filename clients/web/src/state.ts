/** What the page shows, and what changes it. */

import { RequestFailed, SketchmatchClient } from "@sketchmatch/client";
import type { AlternativeMap, ObjectMatch } from "@sketchmatch/client/v1/match";
import { batch, computed, effect, signal } from "@preact/signals";

import { type Carried, carry, type ToCarry } from "./carry";
import {
  carriedStrokes,
  change,
  drawing,
  EMPTY,
  pins,
  pinStrokes,
  replace,
  stretchStrokes,
  type Stroke,
  thingStrokes,
} from "./document";
import { ink, inkOf, packed, parseStrokes, unpacked } from "./files";
import { boxOf, isInside, outlineAround, type Xy } from "./geometry";
import { keepDrawing, keepMap, restored } from "./keep";
import {
  type Chosen,
  foundOtherwise,
  isPlace,
  isMetric,
  openMap,
  openOutlines,
  keepOnServer,
  listStored,
  mended,
  openPlace,
  openStored,
  type Place,
  type PlaceMap,
  sampleSketch,
  type StoredMap,
  type Thing,
} from "./maps";
import { NotSent, type Robot, robots, send } from "./robot";
import { type Answered, type Progress, Session } from "./session";
import { remember, remembered } from "./settings";
import { texts, told } from "./texts";

export type Tool = "pen" | "route" | "zone" | "eraser" | "move" | "name";
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
  /** All that is one here: where several are one of the other side, more than the one above. */
  readonly all: { readonly sketch: readonly number[]; readonly map: readonly number[] };
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
export const theme = signal(themeNamed(remembered("theme")));
export const dark = signal(false);
/** Grows each time the sheets are to be shown whole. */
export const refit = signal(0);

export const client = new SketchmatchClient(location.origin, {
  token: () => remembered("token", "tab") ?? "",
});

/** When the first answer to each change was on the screen, as `performance.now()` has it. */
export const shownAt: number[] = [];
let isAsked = false;

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
        running.value = event.answered.result.provisional;
        trouble.value = null;
        reading.value = 0;
        answered.value = event.answered;
        if (isAsked) whenShown(() => shownAt.push(performance.now()));
        isAsked = false;
        break;
      case "failed":
        running.value = false;
        trouble.value = event.failure;
        if (event.failure.failure === "invalid") answered.value = null;
    }
  }),
);

/** Do something once the frame that is next is painted. */
function whenShown(act: () => void): void {
  requestAnimationFrame(() => setTimeout(act));
}

export const readings = computed(() => 1 + (answered.value?.result.alternatives.length ?? 0));

/** The object map of the reading that is shown, in the order of the sketch. */
const lines = computed<readonly ObjectMatch[]>(() => {
  const result = answered.value?.result;
  const other: AlternativeMap | undefined = result?.alternatives[reading.value - 1];
  return (other ?? result)?.objectMatches ?? [];
});

/** Its lines as they are shown. */
export const pairs = computed<readonly Pair[]>(() => {
  const found = answered.value;
  if (!found) return [];
  const groups = reading.value === 0 ? found.result.objectGroups : [];
  const grouped = new Set(groups.flatMap(({ sketchObjects }) => sketchObjects));
  const single = lines.value.filter(({ sketchObject }) => !grouped.has(sketchObject));
  return [
    ...single.map(({ sketchObject, mapObject, probability }) => ({
      all: { sketch: [sketchObject], map: [mapObject] },
      probability,
    })),
    ...groups.map(({ sketchObjects, mapObjects, probability }) => ({
      all: { sketch: sketchObjects, map: mapObjects },
      probability,
    })),
  ]
    .map(({ all, probability }) => {
      const [sketch = 0, map = 0] = [all.sketch[0], all.map[0]];
      const pinned = pinOf(found, sketch) === found.map.things[map]?.id;
      return { sketch, map, all, probability, pinned };
    })
    .sort((one, other) => one.sketch - other.sketch);
});

export const elsewhere = computed(
  () => (answered.value?.result.placeProbability ?? 1) < 0.5 && reading.value === 0,
);

/** Sketched and mapped things without partner in the reading that is shown. */
export const alone = computed(() => {
  const found = answered.value;
  const drawn = new Set(pairs.value.flatMap(({ all }) => all.sketch));
  const mapped = new Set(pairs.value.flatMap(({ all }) => all.map));
  return {
    sketch: (found?.sketched ?? []).map((_, k) => k).filter((k) => !drawn.has(k)),
    map: (found?.map.things ?? []).map((_, k) => k).filter((k) => !mapped.has(k)),
  };
});

/** What to ask where several readings fit: a sketched thing, and what it may be. */
export const question = computed(() => {
  const { question: asked, result } = answered.value ?? {};
  if (!asked) return null;
  const candidates = asked.options.flatMap(({ mapObject }) =>
    mapObject === undefined ? [] : [mapObject],
  );
  return { sketch: asked.sketchObject, maps: result?.ambiguity?.maps ?? 0, candidates };
});

/** Half the width of the robot, in metres: how far routes stay away from walls and things. */
export const radius = signal(Number(remembered("radius") ?? 0.2) || 0);

export function setRadius(metres: number): void {
  remember("radius", `${metres}`);
  radius.value = metres;
}

/** Routes and zones as the robot would have them; empty where there are none, or nothing to carry by. */
export const carried = signal<readonly Carried[]>([]);
/** Why they could not be carried; empty if nothing is wrong. */
export const carryTrouble = signal("");

const toCarry = computed<ToCarry | null>(() => {
  const [found, strokes] = [answered.value, carriedStrokes.value];
  if (!found || !strokes.length || elsewhere.value || lines.value.length < 2) return null;
  return { found, strokes, lines: lines.value, radius: radius.value };
});

let carrying: AbortController | null = null;

effect(() => {
  const wanted = toCarry.value;
  carrying?.abort();
  if (!wanted) {
    carried.value = [];
    carryTrouble.value = "";
  } else if (!wanted.found.result.provisional) {
    void carryOver(wanted, (carrying = new AbortController()).signal);
  }
});

async function carryOver(wanted: ToCarry, signal: AbortSignal): Promise<void> {
  try {
    const there = await carry(client, wanted, signal);
    if (signal.aborted) return;
    carried.value = there;
    carryTrouble.value = "";
  } catch (thrown) {
    if (signal.aborted) return;
    const failed = RequestFailed.from(thrown);
    carried.value = [];
    carryTrouble.value = failed.message;
    if (failed.failure !== "busy" && failed.failure !== "away") return;
    const wait = 1000 * (failed.retrySeconds ?? 0) || 1500;
    setTimeout(() => !signal.aborted && void carryOver(wanted, signal), wait);
  }
}

/** The ROS bridges that routes may be sent to; null until somebody has asked. */
export const bridges = signal<readonly string[] | null>(null);
export const robot = signal<Robot>({
  url: "",
  topic: "/sketched_route",
  frame: "map",
  ...chosenRobot(),
});
export const sending = signal(false);

function chosenRobot(): Partial<Robot> {
  try {
    return JSON.parse(remembered("robot") ?? "{}") as Partial<Robot>;
  } catch {
    return {}; // another page of this address has one, too
  }
}

export async function lookForRobots(): Promise<void> {
  bridges.value ??= await robots();
}

/** Send the routes on the map to a robot, and say whether they are there. */
export async function sendRoutes(to: Robot): Promise<void> {
  const t = texts.peek();
  robot.value = to;
  remember("robot", JSON.stringify(to));
  sending.value = true;
  try {
    for (const way of carried.peek()) {
      if (way.kind === "route" && way.lines.length) await send(way, to);
    }
    notice.value = t.sent(to.topic);
  } catch (thrown) {
    const said = thrown instanceof NotSent ? thrown.said : String(thrown);
    notice.value = said ? t.refused(to.url, said) : t.noRobot(to.url);
  } finally {
    sending.value = false;
  }
}

/** Return the pair of a thing, if it has one. */
export function pairOf(thing: Lit | null): Pair | undefined {
  if (!thing) return undefined;
  return pairs.value.find(({ all }) => all[thing.side].includes(thing.index));
}

export function isLit(side: Side, index: number): boolean {
  const thing = lit.value;
  if (!thing) return false;
  if (thing.side === side && thing.index === index) return true;
  return pairOf(thing)?.all[side].includes(index) ?? false;
}

export function sketchName(index: number): string {
  return answered.value?.sketched[index]?.label || texts.value.thing(index + 1);
}

export function mapName(index: number): string {
  return place.value?.things[index]?.label || texts.value.thing(index + 1);
}

/** Return what a route or a zone is called; zones without a name are counted. */
export function nameOfCarried({ id, kind, name }: Carried): string {
  const t = texts.value;
  if (name || kind === "route") return name || t.route;
  const zones = carried.value.filter((other) => other.kind === "zone");
  return zones.length > 1 ? `${t.zone} ${1 + zones.findIndex((each) => each.id === id)}` : t.zone;
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
  const strokes = thingStrokes.peek();
  isAsked = true;
  cancelled.value = false;
  trouble.value = null;
  asking.value = null;
  if (map?.things.length && strokes.length) session.update(strokes, pins.peek(), map);
  else {
    session.cancel();
    running.value = false;
    answered.value = null;
  }
}

/** The maps before somebody mended the one that is shown, the latest last. */
const mendedFrom = signal<readonly PlaceMap[]>([]);
export const canUnmend = computed(() => mendedFrom.value.length > 0);
/** The things of the map that are about to be mended; null while nobody mends. */
export const mending = signal<ReadonlySet<number> | null>(null);

/** Show another map; what was said of the former one holds no longer. */
function show(map: PlaceMap, from: readonly PlaceMap[] = []): void {
  batch(() => {
    mendedFrom.value = from;
    if (mending.peek()) mending.value = new Set();
    answered.value = null;
    lit.value = null;
    place.value = map;
  });
}

function forgetPins(): void {
  change((now) => (now.pins.length ? { ...now, pins: [] } : now));
}

/** Forget what was said about the map that was shown before. */
function forget(): void {
  change((now) => (now.pins.length || now.scale ? { ...now, pins: [], scale: undefined } : now));
}

/** Return width and height of a sketched thing as drawn, in units of the map; null if unknown. */
export function sizeOf(sketch: number): readonly [number, number] | null {
  const found = answered.value;
  const ids = new Set(found?.strokesOf[sketch]);
  const scale = drawing.value.scale ?? found?.result.scale ?? 0;
  const { strokes } = drawing.value;
  const { x0, y0, x1, y1 } = boxOf(strokes.flatMap((s) => (ids.has(s.id) ? s.points : [])));
  return scale > 0 && x1 > x0 && y1 > y0 ? [scale * (x1 - x0), scale * (y1 - y0)] : null;
}

/** Make a sketched thing as wide and as high as somebody says, in units of the map. */
export function resize(sketch: number, [width, height]: readonly [number, number]): void {
  const [size, found] = [sizeOf(sketch), answered.peek()];
  const scale = drawing.peek().scale ?? found?.result.scale;
  if (!size || !scale) return;
  const ids = new Set(found?.strokesOf[sketch]);
  const about = asking.peek();
  stretchStrokes(ids, [width / size[0], height / size[1]], scale);
  asking.value = about; // it is the same thing, and its other side may be typed next
}

/** Return what the map's units are called; empty where nobody knows. */
export const unit = computed(() => (place.value && isMetric(place.value) ? "m" : ""));

export function newSheet(): void {
  change((now) => (now.strokes.length ? EMPTY : now));
}

export async function choosePlace(name: Place): Promise<void> {
  await telling(async () => {
    show(await openPlace(client, name));
    forget();
    refit.value++;
  });
}

export async function bringMap(files: readonly File[] | Promise<File[]>): Promise<void> {
  await telling(async () => {
    const map = await openMap(client, await files, texts.peek());
    show(map);
    forget();
    tellOf(map.title, map.warnings);
    refit.value++;
  });
}

/** The maps that the server keeps; null where it keeps none. */
export const storedMaps = signal<readonly StoredMap[] | null>(null);

/** What is wrong with what the server keeps; empty if nothing is. */
export const storeTrouble = signal("");

export async function lookForStored(): Promise<void> {
  storeTrouble.value = "";
  try {
    storedMaps.value = await listStored(client);
  } catch (thrown) {
    storedMaps.value = null;
    const { failure, message, reason } = RequestFailed.from(thrown);
    // The answer's pane tells of a server that does not answer.
    if (failure === "store" || failure === "failed") storeTrouble.value = told({ reason, message });
  }
}

export async function chooseStored({ name }: StoredMap): Promise<void> {
  await telling(async () => {
    show(await openStored(client, name));
    forget();
    refit.value++;
  });
}

/** Have the server keep the map that is shown, under a name. */
export async function keepShown(title: string): Promise<void> {
  const map = place.peek();
  if (!map) return;
  await telling(async () => {
    const kept = await keepOnServer(client, map, title);
    if (place.peek() === map) place.value = kept;
    notice.value = texts.peek().kept(title);
  });
}

export async function bringSketch(file: File): Promise<void> {
  await telling(async () => {
    let strokes: Stroke[] | null = null;
    let noted: readonly string[] = [];
    if (file.name.toLowerCase().endsWith(".json")) strokes = parseStrokes(await file.text());
    if (!strokes) {
      const { outlines, route, warnings } = await openOutlines(client, file);
      strokes = inkOf(outlines, route);
      noted = warnings;
    }
    const brought = strokes;
    change(() => ({ strokes: brought, pins: [] }));
    tellOf(file.name, noted);
    refit.value++;
  });
}

let finding = 0;

/** Look for the things of the map again, with another segmenter or other parameters. */
export async function findOtherwise(chosen: Chosen): Promise<void> {
  const map = place.peek();
  if (!map) return;
  await telling(async () => {
    const asked = ++finding;
    const other = await foundOtherwise(client, map, chosen);
    // Another map, or another way of looking, was chosen meanwhile.
    if (place.peek() !== map || asked !== finding) return;
    show(other);
    forget();
    if (!other.things.length) tellOf(other.title, other.warnings);
    if (other.found.segmenter !== map.found.segmenter) refit.value++;
  });
}

/** Take things off the map, as if the robot had not seen them. */
export function leaveOut(indices: ReadonlySet<number>): Promise<void> {
  return mend((things) => things.filter((_, k) => !indices.has(k)).map((thing) => [thing]));
}

/** Make one thing of several, with the outline around all and the first name that one has. */
export function mergeThings(indices: ReadonlySet<number>): Promise<void> {
  const first = Math.min(...indices);
  return mend((things) => {
    const parts = things.filter((_, k) => indices.has(k));
    const rings = [outlineAround(parts.flatMap((part) => part.rings[0] ?? []))];
    const label = parts.find((part) => part.label)?.label ?? "";
    return things.flatMap((thing, k) => {
      if (k === first) return [[{ ...thing, rings, label }, ...parts]];
      return indices.has(k) ? [] : [[thing]];
    });
  });
}

export function nameThing(index: number, label: string): Promise<void> {
  return mend((things) => things.map((thing, k) => [k === index ? { ...thing, label } : thing]));
}

/** Take back the last thing that was mended. */
export function unmend(): void {
  const [before, ...earlier] = [...mendedFrom.peek()].reverse();
  if (!before) return;
  show(before, earlier.reverse());
  forgetPins();
}

/** Mend the map: each thing that it then has, followed by those it was made of. */
async function mend(next: (things: readonly Thing[]) => Thing[][]): Promise<void> {
  const map = place.peek();
  if (!map) return;
  const made = next(map.things);
  const title = isPlace(map.place) ? texts.peek().place[map.place] : map.title;
  await telling(async () => {
    const things = made.flatMap(([thing]) => (thing ? [thing] : []));
    const other = await mended(client, { ...map, place: "", title }, things);
    if (place.peek() !== map) return; // another one was chosen meanwhile
    const from = [...mendedFrom.peek(), map];
    // What was said of a thing holds for what became of it.
    const thingOf = (id: string | null) =>
      id === null
        ? null
        : other.things[made.findIndex((all) => all.some((one) => one.id === id))]?.id;
    batch(() => {
      show(other, from);
      change((now) => {
        if (!now.pins.length) return now;
        const pins = now.pins.flatMap(({ strokes, thing }) => {
          const there = thingOf(thing);
          return there === undefined ? [] : [{ strokes, thing: there }];
        });
        return { ...now, pins };
      });
    });
  });
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

/** Whether others can open the map that is shown: one of the gallery, or one that the server keeps. */
export const canBeLinked = computed(() => addressOf(place.value) !== "");

function addressOf(map: PlaceMap | null): string {
  return map?.place || (map?.found.stored ? KEPT_BY_SERVER + map.found.stored : "");
}

const KEPT_BY_SERVER = "stored/";

export async function link(): Promise<string> {
  const shared = { place: addressOf(place.peek()), drawing: drawing.peek() };
  return `${location.origin}${location.pathname}#${await packed(shared)}`;
}

/** Whether the server wants a token, or another one; what was typed may be none at all. */
export function wantsToken(failed: RequestFailed | null | undefined): boolean {
  return failed?.failure === "unauthenticated" || failed?.field === "token";
}

export function showToken(token: string): void {
  remember("token", token.trim(), "tab");
  trouble.value = null;
  if (place.peek()) matchNow();
  else void mapped(wantedMap);
}

let wantedMap: string | PlaceMap = "living-room";

/** Show what was there before, or what the link says, and keep it from now on. */
export async function start(): Promise<void> {
  const linked = location.hash.length > 1 ? await unpacked(location.hash.slice(1)) : null;
  if (location.hash.length > 1) {
    history.replaceState(null, "", location.pathname);
    if (!linked) notice.value = texts.peek().brokenLink;
  }
  const kept = await restored();
  replace((linked ?? kept)?.drawing ?? EMPTY);
  wantedMap = (linked ? linked.place : kept?.map) || wantedMap;
  await mapped(wantedMap);
  effect(() => keepDrawing(drawing.value));
  effect(() => {
    const here = place.value;
    if (here) void keepMap(here.place || here);
  });
}

/** Failures of a map that is not there, or not for whoever asks. */
const FOR_OTHERS: ReadonlySet<string> = new Set(["gone", "invalid", "store", "failed"]);

async function mapped(map: string | PlaceMap): Promise<void> {
  if (typeof map !== "string") {
    show(map);
    return;
  }
  for (;;) {
    try {
      if (map.startsWith(KEPT_BY_SERVER)) {
        show(await openStored(client, map.slice(KEPT_BY_SERVER.length)));
      } else show(await openPlace(client, isPlace(map) ? map : "living-room"));
      refit.value++;
      return;
    } catch (thrown) {
      const failed = RequestFailed.from(thrown);
      if (map.startsWith(KEPT_BY_SERVER) && FOR_OTHERS.has(failed.failure)) {
        notice.value = failed.message;
        map = "living-room";
        continue;
      }
      trouble.value = failed;
      if (trouble.value.failure !== "away" && trouble.value.failure !== "busy") return;
      await new Promise((later) => setTimeout(later, 1500));
    }
  }
}

/** Tell what the server noted of a file, as what it left out. */
function tellOf(file: string, noted: readonly string[]): void {
  if (noted.length) notice.value = texts.peek().noted(file, noted.join(" "));
}

async function telling(work: () => Promise<void>): Promise<void> {
  notice.value = "";
  try {
    await work();
  } catch (thrown) {
    const failed = RequestFailed.from(thrown);
    if (failed.failure === "away") trouble.value = failed;
    else notice.value = told(failed);
  }
}

effect(() => {
  void [thingStrokes.value, pins.value, place.value];
  matchNow();
});

// Browsers hold few connections to a server, and a page that nobody looks at needs none.
document.addEventListener("visibilitychange", () => {
  if (document.visibilityState === "visible") session.wake();
  else if (!running.peek()) session.rest();
});
addEventListener("pagehide", () => session.rest());
addEventListener("pageshow", () => session.wake());

const prefersDark = matchMedia("(prefers-color-scheme: dark)");
const paint = () => {
  dark.value = theme.value === "dark" || (theme.value === "auto" && prefersDark.matches);
  document.documentElement.dataset["theme"] = dark.value ? "dark" : "light";
};
prefersDark.addEventListener("change", paint);
effect(paint);

function themeNamed(name: string | null): Theme {
  return name === "light" || name === "dark" ? name : "auto";
}

export function choose(shown: Theme): void {
  remember("theme", shown);
  theme.value = shown;
}
