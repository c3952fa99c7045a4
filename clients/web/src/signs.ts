/** Where the numbers and names of things stand, so that none lies upon another. */

import { type Box, boxOf, type Xy } from "./geometry";

/** What a thing wants to be told by, in pixels of the screen. */
export interface Signed {
  readonly outline: readonly Xy[];
  readonly centre: Xy;
  readonly numbered: boolean;
  /** How wide its name is; 0 if it has none. */
  readonly nameWidth: number;
}

/** Where the number's middle is, and the middle of the line that the name stands on. */
export interface Signs {
  readonly badge: Xy | null;
  readonly label: Xy | null;
}

/** Of a badge, its rim included. */
const RADIUS = 12;
const SMALL = 30;
/** How far a name reaches above and below the line that it stands on. */
const [ABOVE, BELOW] = [11, 4];
/** A name further than that from its thing would be taken for another thing's. */
const FURTHEST = 40;
const STEP = 6;

/**
 * Return where the signs of things stand: numbers first, in or beside their thing; then names, below
 * or beside it. A name that finds no room near its thing is left out.
 */
export function placed(things: readonly Signed[]): Signs[] {
  const taken: Box[] = [];
  const take = (places: Iterable<Xy>, boxAt: (place: Xy) => Box): Xy | null => {
    for (const place of places) {
      const box = boxAt(place);
      if (taken.some((other) => overlap(box, other))) continue;
      taken.push(box);
      return place;
    }
    return null;
  };
  const badges = things.map((thing) =>
    thing.numbered ? take(placesOfBadge(thing), badgeBox) : null,
  );
  return things.map((thing, k) => {
    const [badge = null, width] = [badges[k], thing.nameWidth];
    const label = width ? take(placesOfLabel(thing, badge), (at) => labelBox(at, width)) : null;
    return { badge, label };
  });
}

export function badgeBox([x, y]: Xy): Box {
  return { x0: x - RADIUS, y0: y - RADIUS, x1: x + RADIUS, y1: y + RADIUS };
}

export function labelBox([x, y]: Xy, width: number): Box {
  return { x0: x - width / 2, y0: y - ABOVE, x1: x + width / 2, y1: y + BELOW };
}

function overlap(a: Box, b: Box): boolean {
  return a.x0 < b.x1 && b.x0 < a.x1 && a.y0 < b.y1 && b.y0 < a.y1;
}

/** In a large thing; beside a small one, which it would hide. It is found somewhere in the end. */
function* placesOfBadge({ outline, centre }: Signed): Generator<Xy> {
  const { x0, y0, x1, y1 } = boxOf(outline);
  const corners: Xy[] = [
    [x1 + 3, y0 - 3],
    [x0 - 3, y0 - 3],
    [x1 + 3, y1 + 3],
    [x0 - 3, y1 + 3],
  ];
  const first = Math.min(x1 - x0, y1 - y0) < SMALL ? corners : [centre, ...corners];
  yield* first;
  yield* around(first[0] ?? centre, Infinity);
}

function* placesOfLabel({ outline, centre, nameWidth }: Signed, badge: Xy | null): Generator<Xy> {
  const { x0, y0, x1, y1 } = boxOf(outline);
  const [cx, cy] = centre;
  const within: Xy = [cx, cy + (badge ? RADIUS + BELOW + ABOVE : BELOW)];
  const below: Xy = [cx, y1 + BELOW + ABOVE + 1];
  const side = 6 + nameWidth / 2;
  const first = Math.min(x1 - x0, y1 - y0) < SMALL ? below : within;
  yield* [first, below, [cx, y0 - BELOW - 1], [x1 + side, cy + BELOW], [x0 - side, cy + BELOW]];
  yield* around(first, FURTHEST);
}

/** Places around a point, the nearest first. */
function* around([x, y]: Xy, furthest: number): Generator<Xy> {
  for (let radius = STEP; radius <= furthest; radius += STEP) {
    for (let k = 0; k < 8; k++) {
      const turn = (k * Math.PI) / 4;
      yield [x + radius * Math.sin(turn), y + radius * Math.cos(turn)];
    }
  }
}

const widths = new Map<string, number>();
let context: CanvasRenderingContext2D | null | undefined;

/** Return how wide a name is as the page writes it, at its largest. */
export function widthOf(name: string): number {
  let width = widths.get(name);
  if (width === undefined) {
    context ??= document.createElement("canvas").getContext("2d");
    if (context) context.font = `550 12.5px ${getComputedStyle(document.body).fontFamily}`;
    width = context ? context.measureText(name).width : 8 * name.length;
    widths.set(name, width);
  }
  return width;
}
