/** What a person drew and said, with every step of it kept for undoing. */

import { computed, type ReadonlySignal, signal } from "@preact/signals";

import { boxOf } from "./geometry";

/** x and y in units of the paper, y down; seconds; pressure from 0 to 1. */
export type InkPoint = readonly [number, number, number, number];

/** What a stroke is: of a thing, the way that the robot shall take, or an area for it. */
export type StrokeKind = "thing" | "route" | "zone";

export interface Stroke {
  readonly id: string;
  readonly points: readonly InkPoint[];
  readonly label: string;
  readonly kind: StrokeKind;
  /** Whether a pen drew it, whose pressure was felt. */
  readonly pressed: boolean;
}

/** The person said: what these strokes show is that thing of the map; null: it is on no map. */
export interface Pin {
  readonly strokes: readonly string[];
  readonly thing: string | null;
}

export interface Drawing {
  readonly strokes: readonly Stroke[];
  readonly pins: readonly Pin[];
  /** Units of the map for a unit of the paper, once somebody has typed the size of a thing. */
  readonly scale?: number | undefined;
}

/** Longer names are cut off, here as where they are typed. */
export const LONGEST_NAME = 80;

/** Whether something that was kept or sent is a drawing in all its parts. */
export function isDrawing(value: unknown): value is Drawing {
  const { strokes, pins, scale } = (value ?? {}) as Partial<Record<keyof Drawing, unknown>>;
  if (!Array.isArray(strokes) || !strokes.every(isStroke)) return false;
  if (new Set(strokes.map(({ id }) => id)).size < strokes.length) return false;
  if (!Array.isArray(pins) || !pins.every(isPin)) return false;
  return scale === undefined || (Number.isFinite(scale) && (scale as number) > 0);
}

function isStroke(value: unknown): value is Stroke {
  const { id, points, label, kind, pressed } = (value ?? {}) as Partial<
    Record<keyof Stroke, unknown>
  >;
  return (
    typeof id === "string" &&
    0 < id.length &&
    id.length <= 64 &&
    typeof label === "string" &&
    typeof pressed === "boolean" &&
    (kind === "thing" || kind === "route" || kind === "zone") &&
    Array.isArray(points) &&
    points.every(
      (point) => Array.isArray(point) && point.length === 4 && point.every(Number.isFinite),
    )
  );
}

function isPin(value: unknown): value is Pin {
  const { strokes, thing } = (value ?? {}) as Partial<Record<keyof Pin, unknown>>;
  const isText = (each: unknown) => typeof each === "string";
  return Array.isArray(strokes) && strokes.every(isText) && (thing === null || isText(thing));
}

export const EMPTY: Drawing = { strokes: [], pins: [] };

const current = signal<Drawing>(EMPTY);
const past = signal<readonly Drawing[]>([]);
const future = signal<readonly Drawing[]>([]);

/** What there is now. */
export const drawing = computed(() => current.value);
/** The strokes that show things, and those that are carried; the same lists while they say the same. */
export const thingStrokes = sameWhile(() => strokesOf((kind) => kind === "thing"));
export const carriedStrokes = sameWhile(() => strokesOf((kind) => kind !== "thing"));
export const pins = sameWhile(() => current.value.pins);
export const canUndo = computed(() => past.value.length > 0);
export const canRedo = computed(() => future.value.length > 0);

function strokesOf(wanted: (kind: StrokeKind) => boolean): readonly Stroke[] {
  return current.value.strokes.filter(({ kind }) => wanted(kind));
}

function sameWhile<T>(list: () => readonly T[]): ReadonlySignal<readonly T[]> {
  let before: readonly T[] = [];
  return computed(() => {
    const now = list();
    const isSame = now.length === before.length && now.every((each, k) => each === before[k]);
    return isSame ? before : (before = now);
  });
}

/** Change the drawing by a step that can be undone. */
export function change(next: (now: Drawing) => Drawing): void {
  const now = current.peek();
  const changed = next(now);
  if (changed === now) return;
  past.value = [...past.peek(), now];
  future.value = [];
  current.value = changed;
}

/** Show another drawing, with no way back to the one before. */
export function replace(other: Drawing): void {
  past.value = [];
  future.value = [];
  current.value = other;
}

export function undo(): void {
  const before = past.peek().at(-1);
  if (!before) return;
  future.value = [current.peek(), ...future.peek()];
  past.value = past.peek().slice(0, -1);
  current.value = before;
}

export function redo(): void {
  const [after, ...later] = future.peek();
  if (!after) return;
  past.value = [...past.peek(), current.peek()];
  future.value = later;
  current.value = after;
}

export function newId(): string {
  return Math.random().toString(36).slice(2, 10);
}

/** Add a stroke; there is one route at most. */
export function addStroke(stroke: Stroke): void {
  change((now) => ({
    ...now,
    strokes: [
      ...now.strokes.filter(({ kind }) => !(kind === "route" && stroke.kind === "route")),
      stroke,
    ],
  }));
}

export function eraseStrokes(ids: ReadonlySet<string>): void {
  change((now) => ({
    ...now,
    strokes: now.strokes.filter(({ id }) => !ids.has(id)),
    pins: now.pins.filter(({ strokes }) => !strokes.every((id) => ids.has(id))),
  }));
}

export function moveStrokes(ids: ReadonlySet<string>, dx: number, dy: number): void {
  const moved = (stroke: Stroke): Stroke => ({
    ...stroke,
    points: stroke.points.map(([x, y, t, p]) => [x + dx, y + dy, t, p] as const),
  });
  change((now) => ({
    ...now,
    strokes: now.strokes.map((stroke) => (ids.has(stroke.id) ? moved(stroke) : stroke)),
  }));
}

/**
 * Stretch strokes about their middle.
 *
 * The scale by which somebody measured them holds from then on: that of an answer changes with
 * whatever is drawn, and a size that was typed stays what it is.
 */
export function stretchStrokes(
  ids: ReadonlySet<string>,
  [fx, fy]: readonly [number, number],
  scale: number,
): void {
  const box = boxOf(current.peek().strokes.flatMap((s) => (ids.has(s.id) ? s.points : [])));
  const [cx, cy] = [(box.x0 + box.x1) / 2, (box.y0 + box.y1) / 2];
  const stretched = (stroke: Stroke): Stroke => ({
    ...stroke,
    points: stroke.points.map(
      ([x, y, t, p]) => [cx + fx * (x - cx), cy + fy * (y - cy), t, p] as const,
    ),
  });
  change((now) => ({
    ...now,
    scale,
    strokes: now.strokes.map((stroke) => (ids.has(stroke.id) ? stretched(stroke) : stroke)),
  }));
}

/** Name what some strokes show; one name for all of them. */
export function nameStrokes(ids: ReadonlySet<string>, label: string): void {
  change((now) => ({
    ...now,
    strokes: now.strokes.map((stroke) => (ids.has(stroke.id) ? { ...stroke, label } : stroke)),
  }));
}

/** Say what some strokes show; undefined takes back what was said of them. */
export function pinStrokes(strokes: readonly string[], thing: string | null | undefined): void {
  change((now) => {
    const others = now.pins.filter(
      (pin) => !pin.strokes.some((id) => strokes.includes(id)) && !(thing && pin.thing === thing), // no two sketched things are the same one
    );
    return { ...now, pins: thing === undefined ? others : [...others, { strokes, thing }] };
  });
}
