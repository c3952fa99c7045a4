/** Functions that make `Source` messages of sketches and maps. */

import { create } from "@bufbuild/protobuf";

import { invalid, RequestFailed } from "./errors.js";
import { type Scene } from "./gen/sketchmatch/v1/scene_pb.js";
import { type Source, SourceSchema, YAxis } from "./gen/sketchmatch/v1/source_pb.js";

/** Which way y grows: `"down"` on screens. With the wrong one, a sketch becomes its mirror image. */
export type Axis = "up" | "down";

/** A stroke from pen down to pen up: points `[x, y]` or `[x, y, seconds]`, and optionally a name. */
export interface PenStroke {
  readonly points: readonly (readonly number[])[];
  readonly label?: string | undefined;
}

/**
 * A polygon: the outer ring, then holes; optionally a name, and the certainty, above 0 and up to 1,
 * that it is one object.
 */
export interface NamedPolygon {
  readonly rings: readonly (readonly (readonly [number, number])[])[];
  readonly label?: string | undefined;
  readonly certainty?: number | undefined;
}

/** Pose of a grid: its lower left corner in metres, and its yaw in radians, counter-clockwise. */
export interface Origin {
  readonly x: number;
  readonly y: number;
  readonly yaw?: number;
}

/** Returns strokes of a pen as a source. By default y grows down, as on screens. */
export function strokes(drawn: readonly PenStroke[], y: Axis = "down"): Source {
  const value = {
    yAxis: axis(y),
    strokes: drawn.map(({ points, label }) => ({
      label: label ?? "",
      points: points.map(([x, y, seconds]) => ({
        x: x ?? NaN,
        y: y ?? NaN,
        ...(seconds === undefined ? {} : { timeSeconds: seconds }),
      })),
    })),
  };
  return create(SourceSchema, { kind: { case: "strokeSet", value } });
}

/** Returns polygons that are already objects as a source. By default y grows up, as on maps. */
export function polygons(drawn: readonly NamedPolygon[], y: Axis = "up"): Source {
  const value = {
    yAxis: axis(y),
    polygons: drawn.map(({ rings, label, certainty }) => ({
      label: label ?? "",
      rings: rings.map((ring) => ({ points: ring.map(([x, y]) => ({ x, y })) })),
      ...(certainty === undefined ? {} : { certainty }),
    })),
  };
  return create(SourceSchema, { kind: { case: "polygonSet", value } });
}

/** Returns the objects of a scene as a source. */
export function scene(found: Scene): Source {
  const polygons = found.objects.map(({ rings, label, certainty }) => ({
    rings,
    label,
    ...(certainty === undefined ? {} : { certainty }),
  }));
  const value = { polygons, yAxis: YAxis.UP };
  return create(SourceSchema, { kind: { case: "polygonSet", value } });
}

/**
 * Returns a robot's occupancy grid as a source: `data`, `info.width`, `info.resolution` and
 * `info.origin` of a `nav_msgs/OccupancyGrid`. Cells are -1 for unknown and 0 (free) to 100
 * (occupied), row by row from the lowest row.
 */
export function occupancyGrid(
  cells: Int8Array | readonly number[],
  columns: number,
  resolutionMeters: number,
  { x, y, yaw = 0 }: Origin = { x: 0, y: 0 },
): Source {
  const rows = cells.length / columns;
  if (!Number.isInteger(rows)) {
    const sentence = `occupancy_grid.columns is ${columns} for ${cells.length} cells; give the number of cells in a row`;
    throw new RequestFailed(
      sentence,
      "invalid",
      "INVALID_GRID",
      "occupancy_grid.columns",
      undefined,
    );
  }
  const value = {
    rows,
    columns,
    resolutionMeters,
    origin: { xMeters: x, yMeters: y, yawRadians: yaw },
    cells: new Uint8Array(Int8Array.from(cells).buffer),
  };
  return create(SourceSchema, { kind: { case: "occupancyGrid", value } });
}

/** Returns the scene that is stored on the server under a name. */
export function storedScene(name: string): Source {
  return create(SourceSchema, { kind: { case: "storedScene", value: name } });
}

/**
 * Returns a map as ROS map_server saves it: the text of its YAML and the bytes of its picture.
 *
 * `objects` is GeoJSON with its manually corrected objects, in metres; they are used unless a
 * segmenter is chosen.
 */
export function mapServerMap(yaml: string, image: Uint8Array, objects = ""): Source {
  const value = { yaml, image, objects, ownObjects: objects !== "" };
  return create(SourceSchema, { kind: { case: "mapServerMap", value } });
}

/** Returns a picture as a source: PNG, JPEG, WebP, GIF, BMP, TIFF or PGM. */
export function image(data: Uint8Array): Source {
  return create(SourceSchema, { kind: { case: "image", value: { data } } });
}

/** Returns a file of another tool as a source; the ending of its name tells the kind of file. */
export function file(name: string, data: Uint8Array, part = ""): Source {
  return create(SourceSchema, { kind: { case: "file", value: { name, data, part } } });
}

function axis(y: Axis): YAxis {
  if (y === "up") return YAxis.UP;
  if (y === "down") return YAxis.DOWN;
  throw invalid(`y is '${String(y)}'; give 'up', or 'down' for points from a screen`, "y");
}
