/** Drawings as files and links. */

import { RequestFailed } from "@sketchmatch/client";
import { getStroke } from "perfect-freehand";

import {
  type Drawing,
  type InkPoint,
  isDrawing,
  LONGEST_NAME,
  newId,
  type Pin,
  type Stroke,
  type StrokeKind,
} from "./document";
import { boxOf, type Xy } from "./geometry";
import { contentOf } from "./maps";
import { texts } from "./texts";

const LARGEST_LINK = 32 << 20;
const APART = 4;
const MOST_STEPS = 1000;
const ROUTE_NAMES = new Set(["route", "path"]);

/** Return strokes as our JSON has them; zones stand beside, for they are no things. */
export function strokesJson({ strokes }: Drawing): string {
  const saved = ({ points, label, kind }: Stroke) => ({
    ...(kind === "route" ? { label: "route" } : label ? { label } : {}),
    points: points.map(([x, y, t]) => [round(x), round(y), round(t, 3)]),
  });
  const zones = strokes.filter(({ kind }) => kind === "zone").map(saved);
  const others = strokes.filter(({ kind }) => kind !== "zone").map(saved);
  const all = { y_axis: "down", strokes: others, ...(zones.length ? { zones } : {}) };
  return `${JSON.stringify(all)}\n`;
}

/**
 * Read strokes as our JSON has them; null if it is other JSON.
 *
 * @throws RequestFailed if the strokes are of no use.
 */
export function parseStrokes(text: string): Stroke[] | null {
  let document: unknown;
  try {
    document = JSON.parse(text);
  } catch {
    throw broken(texts.peek().noJson);
  }
  if (typeof document !== "object" || document === null || !("strokes" in document)) return null;
  const down = "y_axis" in document && document.y_axis === "down" ? 1 : -1;
  if (Array.isArray(document.strokes) && !document.strokes.length) {
    throw broken(texts.peek().noStrokes);
  }
  const strokes = parsed(document.strokes, "strokes", down).map((stroke): Stroke => {
    const isRoute = ROUTE_NAMES.has(stroke.label.toLowerCase());
    return isRoute ? { ...stroke, label: "", kind: "route" } : stroke;
  });
  const zones = "zones" in document ? parsed(document.zones, "zones", down) : [];
  return [...strokes, ...zones.map((zone): Stroke => ({ ...zone, kind: "zone" }))];
}

function parsed(list: unknown, field: string, down: number): Stroke[] {
  if (!Array.isArray(list)) throw broken(texts.peek().noList(field));
  return list.map((stroke: unknown, k): Stroke => {
    const { points, label } = (stroke ?? {}) as { points?: unknown; label?: unknown };
    if (!Array.isArray(points)) throw broken(texts.peek().noList(`${field}[${k}].points`));
    const read = points.map((point: unknown, i): InkPoint => {
      const [x, y, t = 0] = Array.isArray(point) ? (point as unknown[]) : [];
      if (!Number.isFinite(x) || !Number.isFinite(y)) {
        throw broken(texts.peek().noPoint(`${field}[${k}].points[${i}]`));
      }
      return [x as number, down * (y as number), typeof t === "number" ? t : 0, 0.5];
    });
    return { ...ink(read), label: typeof label === "string" ? label.slice(0, LONGEST_NAME) : "" };
  });
}

/** Return a stroke of these points. */
export function ink(points: readonly InkPoint[], pressed = false): Stroke {
  return { id: newId(), points, label: "", kind: "thing", pressed };
}

/** Return what outlines look like when somebody draws them, about as large as a sheet. */
export function inkOf(outlines: readonly { points: Xy[]; label: string }[], route: Xy[]): Stroke[] {
  const all = [...outlines.flatMap(({ points }) => points), ...route];
  const { x0, y0, x1, y1 } = boxOf(all);
  const factor = 700 / Math.max(x1 - x0, y1 - y0, 1e-9);
  const placed = (points: Xy[]) =>
    ink(points.map(([x, y]) => [factor * (x - x0), factor * (y - y0), 0, 0.5] as const));
  return [
    ...outlines.map(({ points, label }) => ({ ...placed(points), label })),
    ...(route.length ? [{ ...placed(route), kind: "route" as const }] : []),
  ];
}

/**
 * Return points no farther apart than a pen reports them: ink follows them with a lag, which would
 * round the corners of what has few points.
 */
function closeTogether(points: readonly InkPoint[]): InkPoint[] {
  return points.flatMap((to, k): InkPoint[] => {
    const from = points[k - 1];
    if (!from) return [to];
    const far = Math.hypot(to[0] - from[0], to[1] - from[1]);
    const steps = Math.min(Math.max(Math.ceil(far / APART), 1), MOST_STEPS);
    return Array.from({ length: steps }, (_, step) => between(from, to, (step + 1) / steps));
  });
}

function between(from: InkPoint, to: InkPoint, share: number): InkPoint {
  const at = (k: 0 | 1 | 2 | 3) => (1 - share) * from[k] + share * to[k];
  return [at(0), at(1), at(2), at(3)];
}

/** Return the outline of a stroke's ink. */
export function inkOutline(
  stroke: Pick<Stroke, "points" | "pressed" | "kind">,
  last: boolean,
): Xy[] {
  return getStroke(
    closeTogether(stroke.points).map(([x, y, , pressure]) => [x, y, pressure]),
    {
      size: stroke.kind === "thing" ? 5 : 3.5,
      thinning: stroke.kind === "thing" ? 0.45 : 0,
      smoothing: 0.5,
      streamline: 0.3,
      simulatePressure: !stroke.pressed,
      last,
    },
  ).map(([x = 0, y = 0]) => [x, y] as const);
}

/** Go along the closed curve through the middles of an outline. */
export function traced(
  outline: readonly Xy[],
  pen: { move: (to: Xy) => void; bend: (by: Xy, to: Xy) => void },
): void {
  const [first] = outline;
  if (!first || outline.length < 3) return;
  pen.move(first);
  outline.forEach((by, k) => {
    const [nx, ny] = outline[(k + 1) % outline.length] ?? by;
    pen.bend(by, [(by[0] + nx) / 2, (by[1] + ny) / 2]);
  });
}

/** Return that curve as SVG reads it. */
export function pathOf(outline: readonly Xy[]): string {
  const parts: string[] = [];
  const at = ([x, y]: Xy) => `${round(x)},${round(y)}`;
  traced(outline, {
    move: (to) => parts.push(`M${at(to)}Q`),
    bend: (by, to) => parts.push(`${at(by)} ${at(to)} `),
  });
  return parts.length ? `${parts.join("")}Z` : "";
}

/** Return the drawing as SVG that our server reads, each stroke but zones a line with its name. */
export function drawingSvg(drawing: Drawing): string {
  const strokes = drawing.strokes.filter(({ kind }) => kind !== "zone");
  const { x0, y0, x1, y1 } = boxOf(strokes.flatMap(({ points }) => points));
  const box = [x0 - 20, y0 - 20, x1 - x0 + 40, y1 - y0 + 40].map((n) => round(n)).join(" ");
  const lines = strokes.map(({ points, label, kind }) => {
    const name = kind === "route" ? "route" : label;
    const title = name ? `<title>${escaped(name)}</title>` : "";
    const line = points.map(([x, y]) => `${round(x)},${round(y)}`).join(" ");
    return `  <polyline points="${line}">${title}</polyline>`;
  });
  return [
    `<svg xmlns="http://www.w3.org/2000/svg" viewBox="${box}">`,
    `<g fill="none" stroke="#22303c" stroke-width="4" stroke-linecap="round" stroke-linejoin="round">`,
    ...lines,
    "</g>",
    "</svg>\n",
  ].join("\n");
}

/** Return the drawing as Excalidraw opens it, each stroke but zones grouped with its name. */
export function drawingExcalidraw(drawing: Drawing): string {
  const strokes = drawing.strokes.filter(({ kind }) => kind !== "zone");
  const elements = strokes.flatMap(({ id, points, label, kind, pressed }) => {
    const { x0, y0, x1, y1 } = boxOf(points);
    const [x, y] = [points[0]?.[0] ?? 0, points[0]?.[1] ?? 0];
    const name = kind === "route" ? "route" : label;
    const common = { groupIds: name ? [id] : [], angle: 0, strokeColor: "#22303c", opacity: 100 };
    const line = {
      ...common,
      id,
      type: "freedraw",
      x: round(x),
      y: round(y),
      width: round(x1 - x0),
      height: round(y1 - y0),
      strokeWidth: 2,
      points: points.map(([px, py]) => [round(px - x), round(py - y)]),
      pressures: pressed ? points.map(([, , , pressure]) => round(pressure, 3)) : [],
      simulatePressure: !pressed,
    };
    const size = 16;
    const text = {
      ...common,
      id: `${id}-name`,
      type: "text",
      text: name,
      originalText: name,
      x: round((x0 + x1) / 2 - (name.length * size) / 4),
      y: round((y0 + y1) / 2 - size / 2),
      width: (name.length * size) / 2,
      height: 1.25 * size,
      fontSize: size,
      fontFamily: 2,
      textAlign: "center",
      verticalAlign: "middle",
    };
    return name ? [line, text] : [line];
  });
  const file = { type: "excalidraw", version: 2, source: "sketchmatch", elements };
  return `${JSON.stringify({ ...file, appState: {}, files: {} })}\n`;
}

/** What a link says. */
export interface Shared {
  readonly place: string;
  readonly drawing: Drawing;
}

interface Packed {
  p: string;
  s: { d: number[]; l?: string; k?: StrokeKind; i: string }[];
  n: Pin[];
  u?: number;
}

/** Return a drawing packed for a link: differences of whole points, deflated. */
export async function packed({ place, drawing }: Shared): Promise<string> {
  const s = drawing.strokes.map(({ points, label, kind, id }) => {
    let [px, py] = [0, 0];
    const d = points.flatMap(([x, y]) => {
      const [dx, dy] = [Math.round(x) - px, Math.round(y) - py];
      [px, py] = [px + dx, py + dy];
      return [dx, dy];
    });
    return { d, i: id, ...(label ? { l: label } : {}), ...(kind === "thing" ? {} : { k: kind }) };
  });
  const text = JSON.stringify({
    p: place,
    s,
    n: [...drawing.pins],
    ...(drawing.scale ? { u: drawing.scale } : {}),
  } satisfies Packed);
  const data = await through(new Blob([text]), new CompressionStream("deflate-raw"));
  return btoa(String.fromCharCode(...data))
    .replace(/\+/g, "-")
    .replace(/\//g, "_")
    .replace(/=+$/, "");
}

/** Return what a link says; null if it says nothing that is understood. */
export async function unpacked(text: string): Promise<Shared | null> {
  try {
    const data = Uint8Array.from(atob(text.replace(/-/g, "+").replace(/_/g, "/")), (c) =>
      c.charCodeAt(0),
    );
    const plain = await through(new Blob([data]), new DecompressionStream("deflate-raw"));
    const { p, s, n, u } = JSON.parse(new TextDecoder().decode(plain)) as Packed;
    const strokes = s.map(({ d, l, k: kind, i }): Stroke => {
      let [x, y] = [0, 0];
      const points: InkPoint[] = [];
      for (let k = 0; k + 1 < d.length; k += 2) {
        [x, y] = [x + Number(d[k]), y + Number(d[k + 1])];
        points.push([x, y, k / 120, 0.5]);
      }
      return { ...ink(points), id: i, label: l ?? "", kind: kind ?? "thing" };
    });
    const drawing = { strokes, pins: n, ...(u === undefined ? {} : { scale: u }) };
    return isDrawing(drawing) && typeof p === "string" ? { place: p, drawing } : null;
  } catch {
    return null;
  }
}

/** Return what comes out of a stream; a short link may hold more than the browser does. */
async function through(blob: Blob, stream: CompressionStream): Promise<Uint8Array> {
  const parts: Uint8Array[] = [];
  let size = 0;
  const reader = blob.stream().pipeThrough(stream).getReader();
  for (let part = await reader.read(); !part.done; part = await reader.read()) {
    parts.push(part.value);
    size += part.value.length;
    if (size > LARGEST_LINK) {
      await reader.cancel();
      throw new RangeError("the link holds too much");
    }
  }
  return contentOf(new Blob(parts as BlobPart[]));
}

/** Have the browser save a file. */
export function download(name: string, data: Blob): void {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(data);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}

function broken(why: string): RequestFailed {
  return new RequestFailed(texts.peek().broken(why), "invalid", "", "", undefined);
}

function round(value: number, digits = 1): number {
  return Number(value.toFixed(digits));
}

export function escaped(text: string): string {
  return text.replace(/&/g, "&amp;").replace(/</g, "&lt;").replace(/"/g, "&quot;");
}
