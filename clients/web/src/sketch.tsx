/** The paper: ink, and what the answer says of it. */

import { batch, effect, signal, useSignal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";

import { colourOf } from "./colours";
import {
  addStroke,
  drawing,
  eraseStrokes,
  type InkPoint,
  moveStrokes,
  newId,
  type Stroke,
  type StrokeKind,
} from "./document";
import { ink, inkOutline, traced } from "./files";
import {
  boxOf,
  distance,
  distanceToLine,
  fromScreen,
  lengthOf,
  toScreen,
  type View,
  type Xy,
  zoomed,
} from "./geometry";
import { useSize, useView } from "./pane";
import { placed, type Signed } from "./signs";
import { isPlace, type Thing } from "./maps";
import {
  answered,
  asking,
  bringSketch,
  dark,
  fingerDraws,
  isLit,
  lit,
  naming,
  pairOf,
  place,
  showMe,
  thingAt,
  tool,
  type Tool,
} from "./state";
import { texts } from "./texts";

/** Strokes shorter than this on the screen are taps. */
const TAP = 4;
const REACH = 12;

const paths = new WeakMap<Stroke, Path2D>();
const live = signal<InkPoint[] | null>(null);
const offset = signal<Offset | null>(null);

/** Strokes that are being moved, and how far. */
interface Offset {
  readonly ids: ReadonlySet<string>;
  readonly dx: number;
  readonly dy: number;
}

interface Finger {
  at: Xy;
  from: Xy;
}

export function SketchPane() {
  const { element, size } = useSize<HTMLDivElement>();
  const view = useView(size, paperBox, 56, 1.6);
  const still = useRef<HTMLCanvasElement>(null);
  const wet = useRef<HTMLCanvasElement>(null);
  const spaced = useSignal(false);

  useEffect(
    () =>
      eachFrame(() => {
        const [strokes, seen, moved] = [drawing.value.strokes, view.value, offset.value];
        const { width, height } = size.value;
        void dark.value;
        return () => paintStill(still.current, width, height, seen, strokes, moved);
      }),
    [],
  );
  useEffect(
    () =>
      eachFrame(() => {
        const [points, seen] = [live.value, view.value];
        const { width, height } = size.value;
        return () => paintWet(wet.current, width, height, seen, points);
      }),
    [],
  );
  useEffect(() => (element.current ? handled(element.current, view, spaced) : undefined), []);

  const empty = !drawing.value.strokes.length && !live.value;
  const t = texts.value;
  return (
    <div
      ref={element}
      class={`paper tool-${spaced.value ? "hand" : tool.value}`}
      data-testid="paper"
      onDrop={({ dataTransfer }) => {
        const file = dataTransfer?.files[0];
        if (file) void bringSketch(file);
      }}
    >
      <canvas
        ref={still}
        role="img"
        aria-label={`${t.sketch}: ${t.things(answered.value?.sketched.length ?? 0)}`}
      />
      <Things view={view.value} />
      <canvas ref={wet} />
      {empty && <Hint />}
    </div>
  );
}

/** Look at signals whenever they change, and paint what they said last in the next frame. */
function eachFrame(look: () => () => void): () => void {
  let frame = 0;
  const stop = effect(() => {
    const painting = look();
    cancelAnimationFrame(frame);
    frame = requestAnimationFrame(painting);
  });
  return () => {
    stop();
    cancelAnimationFrame(frame);
  };
}

function Hint() {
  const t = texts.value;
  return (
    <div class="hint">
      <p class="hand">{t.paperHint}</p>
      <p>{t.paperHint2}</p>
      {isPlace(place.value?.place ?? "") && (
        <button type="button" class="primary" onClick={() => void showMe()} data-testid="show-me">
          {t.drawForMe}
        </button>
      )}
    </div>
  );
}

/** What the server sees in the ink, in the colours of the answer. */
function Things({ view }: { view: View }) {
  const found = answered.value;
  if (!found) return null;
  const moved = offset.value;
  const signs = placed(signedOfSketch(found.sketched, view));
  return (
    <svg class="overlay" aria-hidden="true">
      {found.sketched.map(({ rings }, k) => {
        if (found.strokesOf[k]?.some((id) => moved?.ids.has(id))) return null;
        const pair = pairOf({ side: "sketch", index: k });
        const d = rings.map((ring) => paperPath(ring, view)).join("");
        const badge = signs[k]?.badge;
        const colour = pair ? colourOf(pair.sketch) : null;
        const state = `${isLit("sketch", k) || asking.value === k ? " lit" : ""}${pair ? "" : " alone"}`;
        return (
          <g key={k} class={`thing${state}`} data-testid={`sketch-thing-${k}`}>
            <path d={d} fill={colour ?? "currentColor"} stroke={colour ?? "currentColor"} />
            {badge && <Badge at={badge} number={(pair?.sketch ?? k) + 1} colour={colour} />}
          </g>
        );
      })}
    </svg>
  );
}

/** Return what the things of a sketch want to be told by: their numbers. */
export function signedOfSketch(
  things: readonly Pick<Thing, "rings" | "centroid">[],
  view: View,
): Signed[] {
  return things.map(({ rings, centroid: [x, y] }) => ({
    outline: (rings[0] ?? []).map(([px, py]) => toScreen(view, [px, -py])),
    centre: toScreen(view, [x, -y]),
    numbered: true,
    nameWidth: 0,
  }));
}

export function Badge(props: { at: Xy; number: number; colour: string | null }) {
  const {
    at: [x, y],
    number,
    colour,
  } = props;
  return (
    <g class={`badge${colour ? "" : " hollow"}`} transform={`translate(${x} ${y})`}>
      <circle r="11" {...(colour ? { fill: colour } : {})} />
      <text dy="0.36em" text-anchor="middle">
        {number}
      </text>
    </g>
  );
}

export function paperPath(ring: readonly Xy[], view: View): string {
  const points = ring.map(([x, y]) =>
    toScreen(view, [x, -y])
      .map((n) => n.toFixed(1))
      .join(","),
  );
  return `M${points.join("L")}Z`;
}

export function paperBox() {
  const points = drawing.peek().strokes.flatMap((stroke) => stroke.points);
  return points.length ? boxOf(points) : null;
}

function prepared(canvas: HTMLCanvasElement | null, width: number, height: number, view: View) {
  const context = canvas?.getContext("2d");
  if (!canvas || !context || !width) return null;
  const ratio = window.devicePixelRatio || 1;
  const [w, h] = [Math.round(width * ratio), Math.round(height * ratio)];
  if (canvas.width !== w) canvas.width = w;
  if (canvas.height !== h) canvas.height = h;
  context.setTransform(1, 0, 0, 1, 0, 0);
  context.clearRect(0, 0, w, h);
  const scale = ratio * view.scale;
  context.setTransform(scale, 0, 0, scale, ratio * view.x, ratio * view.y);
  return context;
}

const INK: Record<StrokeKind, string> = { thing: "--ink", route: "--route", zone: "--zone" };

function inkColour(kind: StrokeKind): string {
  const name = INK[kind];
  return getComputedStyle(document.documentElement).getPropertyValue(name).trim() || "#000";
}

function paintStill(
  canvas: HTMLCanvasElement | null,
  width: number,
  height: number,
  view: View,
  strokes: readonly Stroke[],
  moved: Offset | null,
): void {
  const context = prepared(canvas, width, height, view);
  if (!context) return;
  const colours = {
    thing: inkColour("thing"),
    route: inkColour("route"),
    zone: inkColour("zone"),
  } satisfies Record<StrokeKind, string>;
  for (const stroke of strokes) {
    let path = paths.get(stroke);
    if (!path) paths.set(stroke, (path = inkPath(inkOutline(stroke, true))));
    context.fillStyle = colours[stroke.kind];
    const shifted = moved?.ids.has(stroke.id) ? moved : null;
    if (shifted) context.translate(shifted.dx, shifted.dy);
    context.fill(path);
    if (stroke.kind === "zone") fillArea(context, stroke);
    if (shifted) context.translate(-shifted.dx, -shifted.dy);
  }
}

function inkPath(outline: readonly Xy[]): Path2D {
  const path = new Path2D();
  traced(outline, {
    move: ([x, y]) => path.moveTo(x, y),
    bend: ([cx, cy], [x, y]) => path.quadraticCurveTo(cx, cy, x, y),
  });
  path.closePath();
  return path;
}

function fillArea(context: CanvasRenderingContext2D, { points }: Stroke): void {
  context.globalAlpha = 0.12;
  context.fill(new Path2D(`M${points.map(([x, y]) => `${x},${y}`).join("L")}Z`));
  context.globalAlpha = 1;
}

function paintWet(
  canvas: HTMLCanvasElement | null,
  width: number,
  height: number,
  view: View,
  points: InkPoint[] | null,
): void {
  const context = prepared(canvas, width, height, view);
  if (!context || !points?.length) return;
  const kind = kindOf(tool.peek());
  context.fillStyle = inkColour(kind);
  context.fill(inkPath(inkOutline({ points, pressed: pressed(points), kind }, false)));
}

/** Return what a tool draws. */
function kindOf(chosen: Tool): StrokeKind {
  return chosen === "route" || chosen === "zone" ? chosen : "thing";
}

function pressed(points: readonly InkPoint[]): boolean {
  return points.some(([, , , pressure]) => pressure !== 0.5 && pressure !== 0);
}

/** See to pointers: the pen draws, fingers draw or move the paper, a palm does nothing. */
function handled(
  element: HTMLElement,
  view: { value: View; peek(): View },
  spaced: { value: boolean },
): () => void {
  const fingers = new Map<number, Finger>();
  let drawingBy: number | null = null;
  let panningBy: number | null = null;
  let erased = new Set<string>();
  let start: Xy = [0, 0];
  let began = 0;
  let penSeen = false;
  const pending: { stroke: InkPoint[] } = { stroke: [] };

  const place = (event: PointerEvent | WheelEvent): Xy => {
    const { left, top } = element.getBoundingClientRect();
    return [event.clientX - left, event.clientY - top];
  };
  const paper = (event: PointerEvent): Xy => fromScreen(view.peek(), place(event));
  const inkAt = (event: PointerEvent): InkPoint => {
    const [x, y] = paper(event);
    return [x, y, event.timeStamp / 1000, event.pointerType === "pen" ? event.pressure : 0.5];
  };
  const near = ([x, y]: Xy): Stroke | undefined => {
    const reach = REACH / view.peek().scale;
    const strokes = [...drawing.peek().strokes].reverse();
    return strokes.find(({ points }) => distanceToLine([x, y], points) < reach);
  };
  /** The strokes of the thing at a point, or the one stroke that is near. */
  const touched = (point: Xy): string[] => {
    const stroke = near(point);
    if (stroke && stroke.kind !== "thing") return [stroke.id];
    const thing = thingAt(point);
    const ids = thing === null ? [] : (answered.peek()?.strokesOf[thing] ?? []);
    return ids.length ? [...ids] : stroke ? [stroke.id] : [];
  };
  const select = (point: Xy): void => {
    const thing = thingAt(point);
    lit.value = thing === null ? null : { side: "sketch", index: thing };
    asking.value = thing;
  };
  const drop = (): void => {
    drawingBy = null;
    pending.stroke = [];
    live.value = null;
    offset.value = null;
  };

  const down = (event: PointerEvent): void => {
    if ((event.target as Element).closest("button")) return;
    const isTouch = event.pointerType === "touch";
    if (event.pointerType === "pen" && !penSeen) {
      penSeen = true;
      fingerDraws.value = false; // whoever has a pen rests a hand on the paper
    }
    if (isTouch && drawingBy !== null && !fingers.has(drawingBy)) return; // a palm beside the pen
    event.preventDefault();
    try {
      element.setPointerCapture(event.pointerId);
    } catch {
      // The pointer has gone already.
    }
    const at = place(event);
    if (isTouch) {
      fingers.set(event.pointerId, { at, from: at });
      if (fingers.size > 1 || !fingerDraws.value) {
        drop(); // two fingers move the paper; what one began was meant for that
        return;
      }
    } else if (event.button === 1 || spaced.value) {
      panningBy = event.pointerId;
      start = at;
      return;
    } else if (event.button > 0 && event.pointerType === "mouse") return;
    drawingBy = event.pointerId;
    began = event.timeStamp;
    start = at;
    const [x, y] = paper(event);
    switch (tool.peek()) {
      case "pen":
      case "route":
      case "zone":
        pending.stroke = [inkAt(event)];
        live.value = pending.stroke;
        break;
      case "eraser":
        erased = new Set();
        rub([x, y]);
        break;
      case "move": {
        const ids = touched([x, y]);
        if (ids.length) offset.value = { ids: new Set(ids), dx: 0, dy: 0 };
        break;
      }
    }
  };
  const rub = (point: Xy): void => {
    const stroke = near(point);
    if (stroke && !erased.has(stroke.id)) {
      erased.add(stroke.id);
      eraseStrokes(new Set([stroke.id]));
    }
  };
  const move = (event: PointerEvent): void => {
    const finger = fingers.get(event.pointerId);
    const at = place(event);
    if (finger && drawingBy !== event.pointerId) {
      pinch(event.pointerId, at);
      return;
    }
    if (panningBy === event.pointerId) {
      const now = view.peek();
      view.value = { ...now, x: now.x + at[0] - start[0], y: now.y + at[1] - start[1] };
      start = at;
      return;
    }
    if (drawingBy === null) {
      const thing = event.pointerType === "touch" ? null : thingAt(paper(event));
      if (asking.peek() === null)
        lit.value = thing === null ? null : { side: "sketch", index: thing };
      return;
    }
    if (drawingBy !== event.pointerId) return;
    switch (tool.peek()) {
      case "pen":
      case "route":
      case "zone": {
        const events = event.getCoalescedEvents?.() ?? [];
        for (const each of events.length ? events : [event]) pending.stroke.push(inkAt(each));
        live.value = [...pending.stroke];
        break;
      }
      case "eraser":
        rub(paper(event));
        break;
      case "move":
        if (offset.peek()) {
          const [x0, y0] = fromScreen(view.peek(), start);
          const [x, y] = paper(event);
          offset.value = { ids: offset.peek()?.ids ?? new Set(), dx: x - x0, dy: y - y0 };
        }
    }
  };
  const pinch = (id: number, at: Xy): void => {
    const finger = fingers.get(id);
    if (!finger) return;
    const other = [...fingers].find(([key]) => key !== id)?.[1];
    const now = view.peek();
    const shifted = { ...now, x: now.x + at[0] - finger.at[0], y: now.y + at[1] - finger.at[1] };
    if (other) {
      const factor = distance(at, other.at) / Math.max(distance(finger.at, other.at), 1);
      // The finger that stays holds its point.
      view.value = zoomed(now, other.at, factor);
    } else view.value = shifted;
    finger.at = at;
  };
  const up = (event: PointerEvent): void => {
    const finger = fingers.get(event.pointerId);
    fingers.delete(event.pointerId);
    if (panningBy === event.pointerId) panningBy = null;
    if (finger && drawingBy !== event.pointerId) {
      if (distance(finger.from, finger.at) < TAP) select(paper(event));
      return;
    }
    if (drawingBy !== event.pointerId) return;
    const at = place(event);
    const tapped = distance(at, start) < TAP && event.timeStamp - began < 500;
    const point = paper(event);
    const points = pending.stroke;
    const shift = offset.peek();
    const chosen = tool.peek();
    batch(() => {
      drop();
      done(chosen, { points, shift, point, tapped });
    });
  };
  const done = (
    chosen: Tool,
    made: { points: InkPoint[]; shift: Offset | null; point: Xy; tapped: boolean },
  ): void => {
    const { points, shift, point, tapped } = made;
    switch (chosen) {
      case "pen":
      case "route":
      case "zone":
        if (lengthOf(points) * view.peek().scale >= TAP) {
          const began = points[0]?.[2] ?? 0;
          const timed = points.map(([x, y, t, p]) => [x, y, t - began, p] as const);
          const stroke: Stroke = {
            ...ink(timed, pressed(points)),
            id: newId(),
            kind: kindOf(chosen),
          };
          addStroke(stroke);
        } else if (tapped) select(point);
        break;
      case "move":
        if (shift && (shift.dx || shift.dy)) moveStrokes(shift.ids, shift.dx, shift.dy);
        else if (tapped) select(point);
        break;
      case "name": {
        const ids = touched(point);
        if (ids.length) naming.value = ids;
      }
    }
  };
  const lost = (event: PointerEvent): void => {
    // The system took the pointer away; what was drawn until then is kept.
    if (drawingBy === event.pointerId) up(event);
    fingers.delete(event.pointerId);
  };
  const wheel = (event: WheelEvent): void => {
    event.preventDefault();
    const now = view.peek();
    if (event.ctrlKey || event.metaKey) {
      view.value = zoomed(now, place(event), Math.exp(-event.deltaY * 0.01));
    } else view.value = { ...now, x: now.x - event.deltaX, y: now.y - event.deltaY };
  };
  const away = (): void => {
    if (asking.peek() === null) lit.value = null;
  };
  const key = (event: KeyboardEvent): void => {
    if (event.code !== "Space" || (event.target as Element).closest("button,input,select,dialog"))
      return;
    spaced.value = event.type === "keydown";
  };
  element.addEventListener("pointerdown", down);
  element.addEventListener("pointermove", move);
  element.addEventListener("pointerup", up);
  element.addEventListener("pointercancel", lost);
  element.addEventListener("pointerleave", away);
  element.addEventListener("wheel", wheel, { passive: false });
  window.addEventListener("keydown", key);
  window.addEventListener("keyup", key);
  return () => {
    window.removeEventListener("keydown", key);
    window.removeEventListener("keyup", key);
  };
}
