/** Points, boxes and polygons of the plane. */

export type Xy = readonly [number, number];

export interface Box {
  readonly x0: number;
  readonly y0: number;
  readonly x1: number;
  readonly y1: number;
}

export function boxOf(points: Iterable<readonly number[]>): Box {
  let [x0, y0, x1, y1] = [Infinity, Infinity, -Infinity, -Infinity];
  for (const [x = 0, y = 0] of points) {
    x0 = Math.min(x0, x);
    y0 = Math.min(y0, y);
    x1 = Math.max(x1, x);
    y1 = Math.max(y1, y);
  }
  return { x0, y0, x1, y1 };
}

export function isInside(ring: readonly Xy[], [x, y]: Xy): boolean {
  let inside = false;
  ring.forEach(([ax, ay], k) => {
    const [bx, by] = ring[(k + ring.length - 1) % ring.length] ?? [ax, ay];
    if (ay > y !== by > y && x < ax + ((bx - ax) * (y - ay)) / (by - ay)) inside = !inside;
  });
  return inside;
}

export function areaOf(ring: readonly Xy[]): number {
  let twice = 0;
  ring.forEach(([ax, ay], k) => {
    const [bx, by] = ring[(k + 1) % ring.length] ?? [ax, ay];
    twice += ax * by - bx * ay;
  });
  return Math.abs(twice) / 2;
}

/** Return the convex outline around points, counter-clockwise where y grows up. */
export function outlineAround(points: readonly Xy[]): Xy[] {
  const sorted = [...points].sort(([ax, ay], [bx, by]) => ax - bx || ay - by);
  const half = (along: readonly Xy[]): Xy[] => {
    const kept: Xy[] = [];
    for (const point of along) {
      while (kept.length > 1 && !turnsLeft(kept.at(-2), kept.at(-1), point)) kept.pop();
      kept.push(point);
    }
    return kept.slice(0, -1);
  };
  return [...half(sorted), ...half([...sorted].reverse())];
}

function turnsLeft(a: Xy | undefined, b: Xy | undefined, [cx, cy]: Xy): boolean {
  if (!a || !b) return true;
  return (b[0] - a[0]) * (cy - a[1]) > (b[1] - a[1]) * (cx - a[0]);
}

export function lengthOf(points: readonly (readonly number[])[]): number {
  let length = 0;
  for (let k = 1; k < points.length; k++) length += distance(at(points, k - 1), at(points, k));
  return length;
}

export function distance(a: Xy, b: Xy): number {
  return Math.hypot(a[0] - b[0], a[1] - b[1]);
}

/** Return how far a point is from a line of points. */
export function distanceToLine(point: Xy, line: readonly (readonly number[])[]): number {
  let nearest = line.length ? distance(point, at(line, 0)) : Infinity;
  for (let k = 1; k < line.length; k++) {
    nearest = Math.min(nearest, distanceToSegment(point, at(line, k - 1), at(line, k)));
  }
  return nearest;
}

function distanceToSegment(p: Xy, a: Xy, b: Xy): number {
  const [dx, dy] = [b[0] - a[0], b[1] - a[1]];
  const squared = dx * dx + dy * dy;
  const share = squared ? ((p[0] - a[0]) * dx + (p[1] - a[1]) * dy) / squared : 0;
  const t = Math.min(1, Math.max(0, share));
  return distance(p, [a[0] + t * dx, a[1] + t * dy]);
}

function at(points: readonly (readonly number[])[], k: number): Xy {
  const point = points[k];
  return [point?.[0] ?? 0, point?.[1] ?? 0];
}

/** How a picture lies on the screen: `screen = scale · point + (x, y)`. */
export interface View {
  readonly x: number;
  readonly y: number;
  readonly scale: number;
}

export function toScreen(view: View, [x, y]: Xy): Xy {
  return [view.scale * x + view.x, view.scale * y + view.y];
}

export function fromScreen(view: View, [x, y]: Xy): Xy {
  return [(x - view.x) / view.scale, (y - view.y) / view.scale];
}

/** Return the view with one point of the screen kept, and all else grown by a factor. */
export function zoomed(view: View, [x, y]: Xy, factor: number): View {
  const scale = Math.min(40, Math.max(0.05, view.scale * factor));
  const real = scale / view.scale;
  return { scale, x: x - real * (x - view.x), y: y - real * (y - view.y) };
}

/** Return the view in which a box fills the screen but for a margin. */
export function fitting(box: Box, width: number, height: number, margin: number): View {
  const [w, h] = [Math.max(box.x1 - box.x0, 1e-9), Math.max(box.y1 - box.y0, 1e-9)];
  const room = [Math.max(width - 2 * margin, 40), Math.max(height - 2 * margin, 40)] as const;
  const scale = Math.min(room[0] / w, room[1] / h);
  return {
    scale,
    x: width / 2 - (scale * (box.x0 + box.x1)) / 2,
    y: height / 2 - (scale * (box.y0 + box.y1)) / 2,
  };
}
