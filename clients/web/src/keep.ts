/** Keeps what was drawn in the browser, for when the server or the page goes away. */

import { get, set } from "idb-keyval";

import type { Drawing } from "./document";
import type { PlaceMap } from "./maps";

/** What is kept of one sheet; every tab has its own. */
export interface Kept {
  readonly drawing: Drawing;
  /** A place of the gallery by name, and a map that was brought as a whole. */
  readonly map: string | PlaceMap;
}

const LATEST = "latest";
const mine = tab();

/** Return what this tab had, or else a copy of what was drawn last in any. */
export async function restored(): Promise<Kept | undefined> {
  try {
    const own = await get<Kept>(mine);
    if (own) return own;
    const latest = await get<string>(LATEST);
    return latest === undefined ? undefined : await get<Kept>(latest);
  } catch {
    return undefined; // a private window keeps nothing
  }
}

export async function keep(kept: Kept): Promise<void> {
  try {
    await set(mine, kept);
    await set(LATEST, mine);
  } catch {
    // What is on the screen is all there is then.
  }
}

/** Return the name under which this tab keeps its sheet; it outlives the page, not the tab. */
function tab(): string {
  const name =
    sessionStorage.getItem("sheet") ?? `sheet-${Date.now().toString(36)}-${Math.random()}`;
  sessionStorage.setItem("sheet", name);
  return name;
}
