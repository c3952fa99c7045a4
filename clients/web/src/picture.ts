/** The picture of both sides, in the colours and with the numbers of the page. */

import type { Carried } from "./carry";
import { colourOf } from "./colours";
import { drawing, type Stroke } from "./document";
import { escaped, inkOutline, pathOf } from "./files";
import { fitting, type View, type Xy } from "./geometry";
import {
  ARROW,
  arrowOf,
  flippedBox,
  listed,
  matrix,
  paint,
  pathThrough,
  placing,
  shown,
  signedOf,
} from "./map";
import type { Underlay } from "./maps";
import { placed } from "./signs";
import { paperBox, paperPath, signedOfSketch } from "./sketch";
import { answered, carried, dark, mapName, pairOf, place } from "./state";
import { texts } from "./texts";

/** Of each side, in pixels. */
const [WIDTH, HEIGHT] = [760, 640];
const [GAP, HEAD] = [20, 46];
const TOTAL = [2 * WIDTH + 3 * GAP, HEIGHT + HEAD + GAP] as const;

/** Return the picture as SVG that needs nothing beside it. */
export async function pictureSvg(): Promise<string> {
  const [width, height] = TOTAL;
  const t = texts.peek();
  const head = (side: number, text: string) =>
    `<text x="${GAP + side * (WIDTH + GAP) + 4}" y="31" font-size="17" font-weight="600">${escaped(text)}</text>`;
  const parts = [
    `<svg xmlns="http://www.w3.org/2000/svg" width="${width}" height="${height}" viewBox="0 0 ${width} ${height}" font-family="Inter, 'Segoe UI', system-ui, 'DejaVu Sans', sans-serif" fill="${colour("--text")}">`,
    `<rect width="${width}" height="${height}" fill="${colour("--page")}"/>`,
    head(0, t.sketch),
    head(1, t.map),
    pane(0, "--paper", sketchParts()),
    pane(1, "--floor", await mapParts()),
    "</svg>\n",
  ];
  return parts.join("\n");
}

/** Return a picture as PNG, twice as fine; null where the browser cannot. */
export async function pngOf(svg: string): Promise<Blob | null> {
  const image = new Image();
  image.src = URL.createObjectURL(new Blob([svg], { type: "image/svg+xml" }));
  await image.decode();
  URL.revokeObjectURL(image.src);
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [2 * TOTAL[0], 2 * TOTAL[1]];
  canvas.getContext("2d")?.drawImage(image, 0, 0, canvas.width, canvas.height);
  return new Promise((done) => canvas.toBlob(done));
}

function pane(side: number, background: string, parts: readonly string[]): string {
  return [
    `<svg x="${GAP + side * (WIDTH + GAP)}" y="${HEAD}" width="${WIDTH}" height="${HEIGHT}">`,
    `<rect width="${WIDTH}" height="${HEIGHT}" rx="16" fill="${colour(background)}"/>`,
    ...parts,
    "</svg>",
  ].join("\n");
}

function sketchParts(): string[] {
  const box = paperBox();
  if (!box) return [];
  const view = fitting(box, WIDTH, HEIGHT, 44);
  const sketched = answered.peek()?.sketched ?? [];
  const signs = placed(signedOfSketch(sketched, view));
  const things = sketched.map(({ rings }, k) => {
    const pair = pairOf({ side: "sketch", index: k });
    const painted = pair ? colourOf(pair.sketch) : null;
    const area = `<path d="${rings.map((ring) => paperPath(ring, view)).join("")}" fill="${painted ?? colour("--muted")}" fill-opacity="${painted ? 0.17 : 0.07}"/>`;
    const at = signs[k]?.badge;
    return at ? area + badge(at, (pair?.sketch ?? k) + 1, painted) : area;
  });
  return [
    `<g transform="${moved(view)}">`,
    ...drawing.peek().strokes.map(inkPart),
    "</g>",
    ...things,
  ];
}

function inkPart(stroke: Stroke): string {
  const { kind, points } = stroke;
  const painted = colour(kind === "thing" ? "--ink" : kind === "route" ? "--route" : "--zone");
  const line = `<path d="${pathOf(inkOutline(stroke, true))}" fill="${painted}"/>`;
  if (kind !== "zone") return line;
  return `${line}<polygon points="${listed(points.map(([x, y]) => [x, y]))}" fill="${painted}" fill-opacity="0.12"/>`;
}

async function mapParts(): Promise<string[]> {
  const [map, box] = [place.peek(), flippedBox()];
  if (!map || !box) return [];
  const view = fitting(box, WIDTH, HEIGHT, 30);
  const pairs = map.things.map((_, index) => pairOf({ side: "map", index }));
  const signs = placed(
    signedOf(
      map.things,
      pairs.map((pair) => !!pair),
      view,
    ),
  );
  const things = map.things.map(({ rings }, k) => {
    const [pair, { badge: at, label } = { badge: null, label: null }] = [pairs[k], signs[k]];
    const painted = pair ? colourOf(pair.sketch) : null;
    const line = painted ?? colour("--muted");
    const look = painted
      ? `fill-opacity="0.36" stroke-opacity="0.9"`
      : `fill-opacity="0.12" stroke-opacity="0.9" stroke-dasharray="4 4"`;
    return [
      `<path d="${rings.map((ring) => pathThrough(ring, view)).join("")}" fill="${line}" stroke="${line}" stroke-width="1.6" stroke-linejoin="round" ${look}/>`,
      pair && at ? badge(at, pair.sketch + 1, painted) : "",
      label
        ? `<text x="${fixed(label[0])}" y="${fixed(label[1])}" text-anchor="middle" font-size="12.5" font-weight="550" paint-order="stroke" stroke="${colour("--floor")}" stroke-width="4" stroke-linejoin="round">${escaped(mapName(k))}</text>`
        : "",
    ].join("");
  });
  const ways = carried.peek().map((way) => wayPart(way, view));
  return [map.underlay ? await underlayPart(map.underlay, view) : "", ...ways, ...things];
}

function wayPart({ kind, lines }: Carried, view: View): string {
  const painted = colour(kind === "zone" ? "--zone" : "--route");
  return lines
    .map(({ points }) => points.map((point) => shown(view, point)))
    .map((points) =>
      kind === "zone"
        ? `<polygon points="${listed(points)}" fill="${painted}" fill-opacity="0.1" stroke="${painted}" stroke-width="2.5" stroke-linejoin="round"/>`
        : `<g fill="none" stroke="${painted}" stroke-width="3.5" stroke-linecap="round" stroke-linejoin="round"><polyline points="${listed(points)}" stroke-dasharray="1 8"/><path d="${ARROW}" transform="${arrowOf(points) ?? ""}"/></g>`,
    )
    .join("");
}

async function underlayPart(underlay: Underlay, view: View): Promise<string> {
  const { picture, width, height } = await paint(underlay, dark.peek());
  if (!picture) return "";
  const data = await dataOf(picture);
  const look = underlay.grid ? `image-rendering="pixelated"` : `opacity="0.55"`;
  return `<image href="${data}" width="${width}" height="${height}" transform="${matrix(view)} ${placing(underlay, height)}" ${look}/>`;
}

function badge([x, y]: Xy, number: number, painted: string | null): string {
  const look = painted
    ? `fill="${painted}" stroke="${colour("--paper")}" stroke-width="2"`
    : `fill="${colour("--paper")}" stroke="${colour("--muted")}" stroke-width="1.5" stroke-dasharray="3 2.5"`;
  return `<g transform="translate(${fixed(x)} ${fixed(y)})"><circle r="11" ${look}/><text dy="0.36em" text-anchor="middle" font-size="12" font-weight="700" fill="${painted ? "#fff" : colour("--muted")}">${number}</text></g>`;
}

function moved({ x, y, scale }: View): string {
  return `translate(${fixed(x)} ${fixed(y)}) scale(${scale.toFixed(4)})`;
}

function colour(name: string): string {
  return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
}

function dataOf(blob: Blob): Promise<string> {
  return new Promise((done, failed) => {
    const reader = new FileReader();
    reader.onload = () => done(String(reader.result));
    reader.onerror = () => failed(reader.error);
    reader.readAsDataURL(blob);
  });
}

function fixed(value: number): string {
  return value.toFixed(1);
}
