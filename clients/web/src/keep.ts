/** Keeps what was drawn in the browser, for when the server or the page goes away. */

import { get, getMany, set } from "idb-keyval";

import { type Drawing, isDrawing } from "./document";
import { isMap, type PlaceMap } from "./maps";
import { remember, remembered } from "./settings";

/** What is kept of one sheet; every tab has its own. */
export interface Kept {
  readonly drawing: Drawing;
  /** A place of the gallery by name, and a map that was brought as a whole. */
  readonly map: string | PlaceMap;
}

const LATEST = "latest";
let mine = "";

/** Return what this tab had, or else a copy of what was drawn last in any. */
export async function restored(): Promise<Kept | undefined> {
  try {
    const before = remembered("sheet", "tab");
    mine = await ownName(before);
    return (await sheet(before ?? "")) ?? (await sheet((await get<string>(LATEST)) ?? ""));
  } catch {
    return undefined; // a private window keeps nothing
  }
}

async function sheet(name: string): Promise<Kept | undefined> {
  const [drawing, map] = await getMany<unknown>([name, mapOf(name)]);
  // An earlier page may have kept it otherwise.
  if (!isDrawing(drawing)) return undefined;
  return typeof map === "string" || isMap(map) ? { drawing, map } : undefined;
}

let unkept: Drawing | null = null;

/** Keep a drawing, once it is on its way to the server. */
export function keepDrawing(drawing: Drawing): void {
  if (!unkept) setTimeout(() => void keepNow());
  unkept = drawing;
}

async function keepNow(): Promise<void> {
  const drawing = unkept;
  unkept = null;
  if (drawing) await Promise.all([kept(mine, drawing), kept(LATEST, mine)]);
}

addEventListener("pagehide", () => void keepNow());

/** Keep the map, which may be large and seldom changes, beside what is drawn. */
export async function keepMap(map: Kept["map"]): Promise<void> {
  await kept(mapOf(mine), map);
}

async function kept(name: string, value: unknown): Promise<void> {
  try {
    if (mine) await set(name, value);
  } catch {
    // What is on the screen is all there is then.
  }
}

function mapOf(name: string): string {
  return `${name}/map`;
}

/**
 * Return the name under which this tab keeps its sheet; it outlives the page, not the tab.
 *
 * A tab that was duplicated has the name of the other, which keeps it for as long as it is open.
 */
async function ownName(before: string | null): Promise<string> {
  if (before && (await isFree(before))) return before;
  const name = `sheet-${Date.now().toString(36)}-${Math.random()}`;
  remember("sheet", name, "tab");
  await isFree(name);
  return name;
}

/** Hold a name until the page is left; return whether no other page holds it. */
async function isFree(name: string): Promise<boolean> {
  if (!("locks" in navigator)) return true; // as on pages without TLS
  return new Promise((done) => {
    void navigator.locks.request(name, { ifAvailable: true }, (lock) => {
      done(lock !== null);
      return lock && new Promise(() => undefined);
    });
  });
}
