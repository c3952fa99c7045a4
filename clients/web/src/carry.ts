/** Routes and zones carried to the map, and the files that robots take them from. */

import type { SketchmatchClient } from "@sketchmatch/client";
import { sources } from "@sketchmatch/client";
import type { ObjectMatch } from "@sketchmatch/client/v1/match";
import { YAxis } from "@sketchmatch/client/v1/source";
import {
  ChangeReason,
  type CarriedFeature,
  type FeatureChange,
} from "@sketchmatch/client/v1/transfer_service";

import type { Stroke, StrokeKind } from "./document";
import type { Xy } from "./geometry";
import { asFound } from "./maps";
import type { Answered } from "./session";

/** A line of points, and the standard deviation of each, in units of the map. */
export interface CarriedLine {
  readonly points: readonly Xy[];
  readonly deviations: readonly number[];
}

/** A route or a zone on the map; without lines where nothing of it can be reached. */
export interface Carried {
  readonly id: string;
  readonly kind: Exclude<StrokeKind, "thing">;
  readonly name: string;
  readonly lines: readonly CarriedLine[];
  readonly changes: readonly FeatureChange[];
}

/** What to carry, and by what. */
export interface ToCarry {
  readonly strokes: readonly Stroke[];
  readonly found: Answered;
  /** The object map. */
  readonly lines: readonly ObjectMatch[];
  /** Half the width of the robot, in units of the map. */
  readonly radius: number;
}

/**
 * Carry routes and zones to the map.
 *
 * @throws ConnectError
 */
export async function carry(
  client: SketchmatchClient,
  { strokes, found, lines, radius }: ToCarry,
  signal: AbortSignal,
): Promise<Carried[]> {
  const { features } = await client.transfers.transfer(
    {
      sketch: sources.polygons(found.sketched),
      // The map as it was found, for its walls are no things.
      ...asFound(found.map.found),
      // Things that are left out of the map are still in its source.
      objectMap: lines.map(({ sketchObject, mapObject }) => ({
        sketchObject,
        mapObject: Number(found.map.things[mapObject]?.id),
      })),
      yAxis: YAxis.DOWN,
      radius,
      features: strokes.map(({ points, kind }) => {
        const line = { points: points.map(([x, y]) => ({ x, y })) };
        return {
          kind:
            kind === "zone"
              ? { case: "zone" as const, value: { rings: [line] } }
              : { case: "route" as const, value: line },
        };
      }),
    },
    { signal },
  );
  return features.flatMap((feature, k) => {
    const stroke = strokes[k];
    return stroke ? [carriedOf(feature, stroke)] : [];
  });
}

function carriedOf({ feature, lines, changes }: CarriedFeature, stroke: Stroke): Carried {
  const kind = feature?.kind;
  const there =
    kind?.case === "zone" ? kind.value.rings : kind?.case === "route" ? [kind.value] : [];
  return {
    id: stroke.id,
    kind: stroke.kind === "zone" ? "zone" : "route",
    name: stroke.label,
    lines: there.map(({ points }, k) => ({
      points: points.map(({ x, y }) => [x, y] as const),
      deviations: lines[k]?.deviations ?? [],
    })),
    changes,
  };
}

/** Return what was carried as GeoJSON, in units of the map, as the command line saves it. */
export function geoJson(carried: readonly Carried[]): string {
  const features = carried.map(({ kind, name, lines, changes }) => {
    const deviations = lines.map((line) => line.deviations.map((each) => round(each, 6)));
    return {
      type: "Feature",
      properties: {
        name: name || kind,
        ...(lines.length ? { deviation: median(deviations.flat()), deviations } : {}),
        ...(changes.length ? { changes: changes.map(changeOf) } : {}),
      },
      geometry: geometryOf(kind, lines),
    };
  });
  const all = { type: "FeatureCollection", crs: null, features };
  return `${JSON.stringify(all)}\n`;
}

function changeOf({ reason, firstPoint, lastPoint, sentence }: FeatureChange) {
  const named = ChangeReason[reason].toLowerCase();
  return { reason: named, first: firstPoint, last: lastPoint, sentence };
}

function geometryOf(kind: Carried["kind"], lines: readonly CarriedLine[]) {
  const rings = lines.map(({ points }) => points.map(([x, y]) => [round(x, 6), round(y, 6)]));
  const [first] = rings;
  if (!first) return null;
  if (kind === "route") return { type: "LineString", coordinates: first };
  return { type: "Polygon", coordinates: rings.map((ring) => [...ring, ...ring.slice(0, 1)]) };
}

/** Return the points of routes as nav2's panel in RViz saves waypoints. */
export function waypoints(carried: readonly Carried[]): string {
  const rows = carried
    .filter(({ kind }) => kind === "route")
    .flatMap(({ name, lines }) =>
      (lines[0]?.points ?? []).map((point, k, points) => ({ name, point, yaw: yawAt(points, k) })),
    );
  if (!rows.length) return "waypoints: {}\n";
  const texts = rows.flatMap(({ name, point: [x, y], yaw }, k) => [
    `  waypoint${k}:`,
    `    pose: [${x.toFixed(6)}, ${y.toFixed(6)}, 0.0]`,
    `    orientation: [${Math.cos(yaw / 2).toFixed(6)}, 0.0, 0.0, ${Math.sin(yaw / 2).toFixed(6)}]`,
    ...(name ? [`    name: ${JSON.stringify(name)}`] : []),
  ]);
  return `waypoints:\n${texts.join("\n")}\n`;
}

/** Return where a robot looks at a point of a route: to the next elsewhere, the last as before. */
export function yawAt(points: readonly Xy[], k: number): number {
  const moves = (from: number): Xy | undefined => {
    const [a, b] = [points[from], points[from + 1]];
    return a && b && (a[0] !== b[0] || a[1] !== b[1]) ? [b[0] - a[0], b[1] - a[1]] : undefined;
  };
  let step: Xy | undefined;
  for (let from = k; !step && from + 1 < points.length; from++) step = moves(from);
  for (let from = k - 1; !step && from >= 0; from--) step = moves(from);
  return step ? Math.atan2(step[1], step[0]) : 0;
}

function median(values: readonly number[]): number {
  const sorted = [...values].sort((a, b) => a - b);
  const half = sorted.length / 2;
  const [low, high] = [sorted[Math.ceil(half) - 1], sorted[Math.floor(half)]];
  return round(((low ?? 0) + (high ?? 0)) / 2, 6);
}

function round(value: number, digits: number): number {
  return Number(value.toFixed(digits));
}
