/** Keeps what was drawn in the browser, for when the server or the page goes away. */

import { get, getMany, set } from "idb-keyval";

import type { Drawing } from "./document";
import type { PlaceMap } from "./maps";

/** What is kept of one sheet; every tab has its own. */
export interface Kept {
  readonly drawing: Drawing;
  /** A place of the gallery by name, and a map that was brought as a whole. */
  readonly map: string | PlaceMap;
}

const LATEST = "latest";
/** Longer than an answer takes, shorter than it takes to lose a page. */
const KEPT_MS = 200;
const mine = tab();

/** Return what this tab had, or else a copy of what was drawn last in any. */
export async function restored(): Promise<Kept | undefined> {
  try {
    return (await sheet(mine)) ?? (await sheet((await get<string>(LATEST)) ?? mine));
  } catch {
    return undefined; // a private window keeps nothing
  }
}

async function sheet(name: string): Promise<Kept | undefined> {
  const [drawing, map] = await getMany<Drawing | Kept["map"] | undefined>([name, mapOf(name)]);
  return drawing && map ? { drawing: drawing as Drawing, map: map as Kept["map"] } : undefined;
}

let unkept: Drawing | null = null;

/** Keep a drawing: soon, since what is drawn is answered first, or at once where the page is left. */
export function keepDrawing(drawing: Drawing): void {
  if (!unkept) setTimeout(() => void keepNow(), KEPT_MS);
  unkept = drawing;
}

async function keepNow(): Promise<void> {
  const drawing = unkept;
  unkept = null;
  if (drawing) await Promise.all([kept(mine, drawing), kept(LATEST, mine)]);
}

addEventListener("pagehide", () => void keepNow());
document.addEventListener("visibilitychange", () => void keepNow());

/** Keep the map, which may be large and seldom changes, beside what is drawn. */
export async function keepMap(map: Kept["map"]): Promise<void> {
  await kept(mapOf(mine), map);
}

async function kept(name: string, value: unknown): Promise<void> {
  try {
    await set(name, value);
  } catch {
    // What is on the screen is all there is then.
  }
}

function mapOf(name: string): string {
  return `${name}/map`;
}

/** Return the name under which this tab keeps its sheet; it outlives the page, not the tab. */
function tab(): string {
  const name =
    sessionStorage.getItem("sheet") ?? `sheet-${Date.now().toString(36)}-${Math.random()}`;
  sessionStorage.setItem("sheet", name);
  return name;
}
