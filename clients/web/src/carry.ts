/** A route carried from the sketch to the map, as a preview: one turn and one scale for all of it. */

import type { Xy } from "./geometry";

/** Return a similarity that takes `from` to `to` as well as one can; null for fewer than two. */
export function similarity(from: readonly Xy[], to: readonly Xy[]): ((point: Xy) => Xy) | null {
  if (from.length < 2) return null;
  const [fx, fy] = mean(from);
  const [tx, ty] = mean(to);
  let [along, across, spread] = [0, 0, 0];
  from.forEach(([x, y], k) => {
    const [u, v] = to[k] ?? [0, 0];
    along += (x - fx) * (u - tx) + (y - fy) * (v - ty);
    across += (x - fx) * (v - ty) - (y - fy) * (u - tx);
    spread += (x - fx) ** 2 + (y - fy) ** 2;
  });
  if (!spread) return null;
  const [a, b] = [along / spread, across / spread];
  return ([x, y]) => [tx + a * (x - fx) - b * (y - fy), ty + b * (x - fx) + a * (y - fy)];
}

function mean(points: readonly Xy[]): Xy {
  const sum = points.reduce<Xy>(([x, y], point) => [x + point[0], y + point[1]], [0, 0]);
  return [sum[0] / points.length, sum[1] / points.length];
}
