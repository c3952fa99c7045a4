/** The robot's side: maps, and the things that were found on them. */

import { RequestFailed, sources, type SketchmatchClient } from "@sketchmatch/client";
import type { Scene } from "@sketchmatch/client/v1/scene";
import type { Source } from "@sketchmatch/client/v1/source";

import { boxOf, type Box, type Xy } from "./geometry";
import { texts } from "./texts";

export interface Thing {
  readonly id: string;
  readonly rings: readonly (readonly Xy[])[];
  readonly label: string;
  readonly centroid: Xy;
}

/** A picture under the things, and where it lies: pixels to units of the map, y up. */
export interface Underlay {
  readonly pixels: Blob;
  readonly resolution: number;
  readonly origin: readonly [number, number, number];
  /** Whether it is an occupancy grid, whose greys have a meaning. */
  readonly grid: boolean;
  /** What they mean, as map_server has it; trinary where that is not said. */
  readonly mode?: "scale" | "raw" | undefined;
  /** Whether white is occupied. */
  readonly negate?: boolean;
}

export interface PlaceMap {
  /** Of the gallery, or empty for one that was brought. */
  readonly place: string;
  readonly title: string;
  readonly things: readonly Thing[];
  readonly underlay: Underlay | null;
  readonly warnings: readonly string[];
  /** What its things were found in, and how. */
  readonly found: Found;
}

/** Whether something that was kept is a map, as this page has them. */
export function isMap(value: unknown): value is PlaceMap {
  const { things, found, title } = (value ?? {}) as Partial<PlaceMap>;
  return Array.isArray(things) && typeof title === "string" && found?.source?.kind !== undefined;
}

/** How the things of a map were found, so that they can be looked for otherwise. */
export interface Found {
  readonly source: Source;
  /** Its name among those that the server keeps; empty if it does not. */
  readonly stored: string;
  readonly segmenter: string;
  readonly parameters: Readonly<Record<string, unknown>>;
  /** Whether some of them open into each other, as rooms do: a person may draw two such as one. */
  readonly passages: boolean;
}

/** The bundled places, as folders and as keys of their titles. */
export const PLACES = ["living-room", "kitchen", "office", "workshop", "playground"] as const;
export type Place = (typeof PLACES)[number];

export function isPlace(name: string): name is Place {
  return (PLACES as readonly string[]).includes(name);
}

/** Return what of a map is shown: its things, and something of the walls around them. */
export function boxOfMap(map: PlaceMap): Box {
  const { x0, y0, x1, y1 } = boxOf(map.things.flatMap(({ rings }) => rings[0] ?? []));
  const around = 0.09 * Math.max(x1 - x0, y1 - y0);
  return { x0: x0 - around, y0: y0 - around, x1: x1 + around, y1: y1 + around };
}

/** Load a place of the gallery. */
export async function openPlace(client: SketchmatchClient, place: Place): Promise<PlaceMap> {
  const folder = `places/${place}`;
  const [yaml, pixels] = await Promise.all([
    fetched(`${folder}/map.yaml`).then((answer) => answer.text()),
    fetched(`${folder}/map.png`).then((answer) => answer.blob()),
  ]);
  const source = sources.mapServerMap(yaml, await bytesOf(client, pixels));
  const all = await found(client, source);
  // What the yaml does not name is a piece of a wall.
  const things = all.things.filter(({ label }) => label);
  return { ...all, things, place, title: "", underlay: gridOf(yaml, pixels) };
}

/** Return how a person drew a place of the gallery. */
export async function sampleSketch(place: Place): Promise<string> {
  return (await fetched(`places/${place}/sketch.json`)).text();
}

const BAG = /\.(bag|mcap|db3)$/i;

/** Whether a map's units are metres, as those of a robot's map are. */
export function isMetric({ underlay, found: { source } }: PlaceMap): boolean {
  return underlay?.grid || isBag(source);
}

/** Whether a source is a bag, in which only the server finds the map. */
function isBag({ kind }: Source): boolean {
  return kind.case === "file" && BAG.test(kind.value.name);
}

/** Return the files that were dropped; of a folder, such as a bag or a map is, those in it. */
export async function droppedFiles(transfer: DataTransfer | null): Promise<File[]> {
  // Both are gone once anything was waited for.
  const files = [...(transfer?.files ?? [])];
  const entries = [...(transfer?.items ?? [])].map((item) => item.webkitGetAsEntry());
  const folders = entries.filter((entry) => entry?.isDirectory) as FileSystemDirectoryEntry[];
  if (!folders.length) return files;
  const names = new Set(folders.map(({ name }) => name));
  const inside = await Promise.all(folders.map(filesIn));
  return [...files.filter(({ name }) => !names.has(name)), ...inside.flat()];
}

async function filesIn(folder: FileSystemDirectoryEntry): Promise<File[]> {
  const reader = folder.createReader();
  const files: File[] = [];
  for (;;) {
    const some = await new Promise<FileSystemEntry[]>((done, failed) =>
      reader.readEntries(done, failed),
    );
    if (!some.length) return files;
    for (const entry of some.filter(({ isFile }) => isFile)) {
      const file = entry as FileSystemFileEntry;
      files.push(await new Promise<File>((done, failed) => file.file(done, failed)));
    }
  }
}

/**
 * Load a map from files: a yaml with its picture, or any one file that the server reads.
 *
 * What else lies in the folder of a bag may come along.
 *
 * @throws RequestFailed, with a sentence for people.
 */
export async function openMap(
  client: SketchmatchClient,
  files: readonly File[],
  words: { pictureLacking: (picture: string) => string; manyBags: string },
): Promise<PlaceMap> {
  const bags = files.filter(({ name }) => BAG.test(name));
  if (bags.length > 1) throw new RequestFailed(words.manyBags, "invalid", "", "map", undefined);
  const yaml = files.find(({ name }) => /\.ya?ml$/i.test(name));
  const first = bags[0] ?? files[0];
  if (yaml && !bags.length) {
    const text = await yaml.text();
    const named = /^\s*image\s*:\s*["']?([^"'\n#]+)/m.exec(text)?.[1]?.trim() ?? "";
    const base = named.split(/[\\/]/).at(-1) ?? "";
    const picture = files.find(({ name }) => name === base) ?? files.find((file) => file !== yaml);
    if (!picture) {
      throw new RequestFailed(words.pictureLacking(base), "invalid", "", "map", undefined);
    }
    const source = sources.mapServerMap(text, await bytesOf(client, picture));
    const seen = await shownPixels(picture);
    return {
      ...(await sought(client, source, yaml.name)),
      place: "",
      title: yaml.name,
      underlay: seen && gridOf(text, seen),
    };
  }
  if (!first) {
    throw new RequestFailed(words.pictureLacking(""), "invalid", "", "map", undefined);
  }
  const seen = await sought(
    client,
    sources.file(first.name, await bytesOf(client, first)),
    first.name,
  );
  const underlay = await underlayOf(seen.found.source.kind);
  return { ...seen, place: "", title: first.name, underlay };
}

/**
 * Have these be the things of a map, whatever was found on it.
 *
 * A robot's map keeps its walls: what somebody mended goes beside it, as the command line has it.
 * Labels alone of a map that the server keeps are changed there.
 */
export async function mended(
  client: SketchmatchClient,
  map: PlaceMap,
  things: readonly Thing[],
): Promise<PlaceMap> {
  const { source, stored } = map.found;
  if (stored && isNamedAlone(map.things, things)) return named(client, map, things);
  const { kind } = source;
  const whole: Source =
    kind.case === "mapServerMap"
      ? sources.mapServerMap(kind.value.yaml, kind.value.image, objectsOf(things))
      : sources.polygons(things);
  const seen = await found(client, whole, map.title);
  // Whoever chooses a segmenter begins anew; these stand where none is chosen.
  return { ...map, ...seen, found: { ...seen.found, segmenter: "", parameters: {} } };
}

function isNamedAlone(had: readonly Thing[], has: readonly Thing[]): boolean {
  return had.length === has.length && had.every(({ rings }, k) => rings === has[k]?.rings);
}

async function named(
  client: SketchmatchClient,
  map: PlaceMap,
  things: readonly Thing[],
): Promise<PlaceMap> {
  const labels = things.flatMap(({ id, label }, k) =>
    label === map.things[k]?.label ? [] : [{ object: Number(id), label }],
  );
  const { storedScene } = await client.scenes.updateScene({ name: map.found.stored, labels });
  const stored = storedScene?.name ?? map.found.stored;
  return { ...map, things: thingsOf(storedScene?.scene), found: { ...map.found, stored } };
}

/** Return things as the file beside a robot's map has them. */
function objectsOf(things: readonly Thing[]): string {
  const features = things.map(({ rings, label }) => ({
    type: "Feature",
    properties: label ? { label } : {},
    geometry: {
      type: "Polygon",
      coordinates: rings.map((ring) => [...ring, ...ring.slice(0, 1)]),
    },
  }));
  return JSON.stringify({ type: "FeatureCollection", features });
}

/** A map that the server keeps. */
export interface StoredMap {
  readonly name: string;
  /** What it is called, or else what is on it. */
  readonly title: string;
  readonly things: number;
}

/** Return the maps that the server keeps, the latest first; null where it keeps none. */
export async function listStored(client: SketchmatchClient): Promise<StoredMap[] | null> {
  if (!(await client.info()).keepsScenes) return null;
  const { scenes } = await client.scenes.listScenes({});
  return scenes.map(({ name, title, labels, objectCount }) => ({
    name,
    title: titleOf(name, title, labels),
    things: objectCount,
  }));
}

function titleOf(name: string, title: string, labels: readonly string[]): string {
  return title || labels.slice(0, 3).join(", ") || name.slice(0, 8);
}

/** Load a map that the server keeps. */
export async function openStored(client: SketchmatchClient, name: string): Promise<PlaceMap> {
  const { storedScene, source: kept } = await client.scenes.getScene({ name, includeSource: true });
  const { scene, warnings, segmenter, passages, title = "" } = storedScene ?? {};
  const how = { segmenter: segmenter?.name ?? "", parameters: segmenter?.parameters ?? {} };
  const chosen = { name: how.segmenter, parameters: parametersOf(how) };
  const source =
    kept && isBag(kept) ? (await sought(client, kept, title, chosen)).found.source : kept;
  const kind = source?.kind;
  const things = thingsOf(scene);
  const labels = things.flatMap(({ label }) => (label ? [label] : []));
  return {
    place: "",
    title: titleOf(name, title, labels),
    things,
    warnings: warnings ?? [],
    underlay: kind ? await underlayOf(kind) : null,
    found: {
      source: source ?? sources.polygons(things),
      stored: name,
      passages: !!passages?.length,
      ...how,
    },
  };
}

/** Have the server keep a map as it was found, under a title. */
export async function keepOnServer(
  client: SketchmatchClient,
  map: PlaceMap,
  title: string,
): Promise<PlaceMap> {
  const { source, segmenter } = map.found;
  const { storedScene } = await client.scenes.putScene({
    source,
    segmenter: { name: segmenter, parameters: parametersOf(map.found) },
    title,
  });
  const stored = storedScene?.name ?? "";
  return { ...map, title, found: { ...map.found, stored } };
}

async function underlayOf(kind: Source["kind"]): Promise<Underlay | null> {
  if (kind.case === "mapServerMap") {
    const seen = await shownPixels(new Blob([new Uint8Array(kind.value.image)]));
    return seen && gridOf(kind.value.yaml, seen);
  }
  const isPicture = kind.case === "image" || kind.case === "file";
  return isPicture ? pictureOf(new Blob([new Uint8Array(kind.value.data)])) : null;
}

/** Return a picture whose pixels are the units of the map. */
async function pictureOf(blob: Blob): Promise<Underlay | null> {
  const seen = await shownPixels(blob);
  return seen && { pixels: seen, resolution: 1, origin: [0, 0, 0], grid: false };
}

/** Return the outlines that the server sees in a file, y down, as a sketch has them. */
export async function openOutlines(
  client: SketchmatchClient,
  file: File,
): Promise<{
  outlines: { points: Xy[]; label: string }[];
  route: Xy[];
  warnings: readonly string[];
}> {
  const source = sources.file(file.name, await bytesOf(client, file));
  const { scene, route, warnings } = await naming(file.name, () => client.segment(source));
  return {
    warnings,
    outlines: thingsOf(scene).map(({ rings, label }) => {
      const ring = (rings[0] ?? []).map(([x, y]) => [x, -y] as const);
      return { points: [...ring, ...ring.slice(0, 1)], label };
    }),
    route: route.map(({ x, y }) => [x, -y] as const),
  };
}

export function thingsOf(scene: Scene | undefined): Thing[] {
  return (scene?.objects ?? []).map(({ rings, label, centroid }, index) => ({
    id: `${index}`,
    label,
    rings: rings.map(({ points }) => points.map(({ x, y }) => [x, y] as const)),
    centroid: [centroid?.x ?? 0, centroid?.y ?? 0],
  }));
}

async function found(
  client: SketchmatchClient,
  source: Source,
  name = "",
  chosen?: Chosen,
): Promise<Pick<PlaceMap, "things" | "warnings" | "found">> {
  const { scene, warnings, segmenter, passages, map } = await naming(name, () =>
    client.segment(source, { segmenter: { ...chosen }, includeMap: isBag(source) }),
  );
  const how = { segmenter: segmenter?.name ?? "", parameters: segmenter?.parameters ?? {} };
  return {
    things: thingsOf(scene),
    warnings,
    found: {
      source: map ? sources.mapServerMap(map.yaml, map.image) : source,
      stored: "",
      passages: passages.length > 0,
      ...how,
    },
  };
}

/** As `found`; where there is nothing to find, other ways of looking may find something. */
async function sought(
  client: SketchmatchClient,
  source: Source,
  name: string,
  chosen: Chosen = { name: "", parameters: {} },
): ReturnType<typeof found> {
  try {
    return await found(client, source, name, chosen);
  } catch (thrown) {
    const { reason, message } = RequestFailed.from(thrown);
    if (reason !== "TOO_FEW_OBJECTS") throw thrown;
    const how = { segmenter: chosen.name, parameters: chosen.parameters };
    return {
      things: [],
      warnings: [message],
      found: { source, stored: "", passages: false, ...how },
    };
  }
}

/** Return what a sketch is matched with: the things as they are shown. */
export function matchedWith({ things, found }: PlaceMap) {
  // Polygons alone do not tell which of them open into each other.
  return found.passages ? asFound(found) : { map: sources.polygons(things) };
}

/** Return a map as it was found, walls and all, as requests have it. */
export function asFound(found: Found) {
  const { source, stored, segmenter: name } = found;
  if (stored) return { map: sources.storedScene(stored) };
  return { map: source, pipeline: { mapSegmenter: { name, parameters: parametersOf(found) } } };
}

/** Return the parameters by which things were found, without those that stand for none. */
export function parametersOf({ parameters }: Pick<Found, "parameters">): Tuned {
  return Object.fromEntries(
    Object.entries(parameters).filter(([, value]) => value !== null),
  ) as Tuned;
}

/** What of a segmenter's parameters a person sets. */
export type Tuned = Record<string, number | boolean | string>;

/** A segmenter as a person chose it; without a name, the server's default. */
export interface Chosen {
  readonly name: string;
  readonly parameters: Tuned;
}

/** Look for the things of a map again, with another segmenter or other parameters. */
export async function foundOtherwise(
  client: SketchmatchClient,
  map: PlaceMap,
  chosen: Chosen,
): Promise<PlaceMap> {
  const seen = await sought(client, map.found.source, map.title, chosen);
  // Where nothing was found in a bag before, its walls are known only now.
  return { ...map, ...seen, underlay: map.underlay ?? (await underlayOf(seen.found.source.kind)) };
}

/** Have errors name the file that a person knows, not the field that it travels in. */
async function naming<T>(name: string, work: () => Promise<T>): Promise<T> {
  try {
    return await work();
  } catch (thrown) {
    const { message, failure, reason, field, retrySeconds } = RequestFailed.from(thrown);
    const told =
      name && field && message.startsWith(field) ? name + message.slice(field.length) : message;
    throw new RequestFailed(told, failure, reason, field, retrySeconds);
  }
}

async function fetched(path: string): Promise<Response> {
  let answer: Response;
  try {
    answer = await fetch(path);
  } catch (thrown) {
    throw new RequestFailed(String(thrown), "away", "", "", undefined);
  }
  if (!answer.ok) throw new RequestFailed(answer.statusText, "away", "", "", undefined);
  return answer;
}

/** Return what is in a file; one that no request can hold is not read first. */
async function bytesOf(client: SketchmatchClient, blob: Blob): Promise<Uint8Array> {
  if (blob.size > ALWAYS_READ) {
    const most = Number((await client.info()).limits?.maxRequestBytes ?? Infinity);
    if (blob.size > most) {
      const name = blob instanceof File ? blob.name : "";
      const said = texts.peek().tooLarge(name, mebibytes(blob.size), mebibytes(most));
      throw new RequestFailed(said, "invalid", "", "", undefined);
    }
  }
  return contentOf(blob);
}

const ALWAYS_READ = 1 << 20;

function mebibytes(size: number): string {
  return `${Math.ceil(size / (1 << 20))} MiB`;
}

export async function contentOf(blob: Blob): Promise<Uint8Array> {
  return new Uint8Array(await blob.arrayBuffer());
}

function gridOf(yaml: string, pixels: Blob): Underlay {
  const number = (key: string) =>
    Number(new RegExp(`^\\s*${key}\\s*:\\s*([^\\s#]+)`, "m").exec(yaml)?.[1]);
  const [x = 0, y = 0, yaw = 0] = (/^\s*origin\s*:\s*\[([^\]]*)\]/m.exec(yaml)?.[1] ?? "")
    .split(",")
    .map(Number);
  const said = /^\s*mode\s*:\s*["']?(scale|raw)\b/im.exec(yaml)?.[1]?.toLowerCase();
  return {
    pixels,
    resolution: number("resolution") || 1,
    origin: [x, y, yaw || 0],
    grid: true,
    mode: said as Underlay["mode"],
    negate: /^\s*negate\s*:\s*(1|true|yes|on|y)\b/im.test(yaml),
  };
}

/** Return a picture that browsers show; null where the file holds none that they know. */
async function shownPixels(file: Blob): Promise<Blob | null> {
  const bytes = await contentOf(file);
  if (bytes[0] === 0x50 && bytes[1] === 0x35) return pngOfPgm(bytes);
  try {
    (await createImageBitmap(file)).close();
    return file;
  } catch {
    return null;
  }
}

/** Robots save maps as binary PGM, which no browser shows. */
async function pngOfPgm(bytes: Uint8Array): Promise<Blob | null> {
  const head = new TextDecoder("latin1").decode(bytes.subarray(0, 4096));
  const match = /^P5(?:\s|#[^\n]*\n)+(\d+)(?:\s|#[^\n]*\n)+(\d+)(?:\s|#[^\n]*\n)+(\d+)\s/.exec(
    head,
  );
  const [width, height, most] = (match?.slice(1) ?? []).map(Number);
  if (!match || !width || !height || !most || most > 255) return null;
  const pixels = new ImageData(width, height);
  for (let k = 0; k < width * height; k++) {
    const shade = Math.round(((bytes[match[0].length + k] ?? 0) * 255) / most);
    pixels.data.set([shade, shade, shade, 255], 4 * k);
  }
  const canvas = new OffscreenCanvas(width, height);
  canvas.getContext("2d")?.putImageData(pixels, 0, 0);
  return canvas.convertToBlob();
}
