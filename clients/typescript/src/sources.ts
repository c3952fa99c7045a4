/** What a person or a robot hands in, as `Source` messages. */

import { create } from "@bufbuild/protobuf";

import { invalid, RequestFailed } from "./errors.js";
import { type Scene } from "./gen/sketchmatch/v1/scene_pb.js";
import { type Source, SourceSchema, YAxis } from "./gen/sketchmatch/v1/source_pb.js";

/** Which way y grows: `"down"` on screens. Read with the wrong one, a sketch is its mirror image. */
export type Axis = "up" | "down";

/** A stroke from pen down to pen up: `[x, y]` or `[x, y, seconds]`, and perhaps a name. */
export interface PenStroke {
  readonly points: readonly (readonly number[])[];
  readonly label?: string | undefined;
}

/** A polygon: the outer ring, then holes, perhaps a name, and how sure it is, up to 1, one thing. */
export interface NamedPolygon {
  readonly rings: readonly (readonly (readonly [number, number])[])[];
  readonly label?: string | undefined;
  readonly certainty?: number | undefined;
}

/** Where a grid lies: its lower left corner, in metres, and radians counter-clockwise. */
export interface Origin {
  readonly x: number;
  readonly y: number;
  readonly yaw?: number;
}

/** Return strokes of a pen. Screens' y grows down, as it does here unless told otherwise. */
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

/** Return polygons that are objects already; a robot's y grows up. */
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

/** Return the objects of a scene as they are. */
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
 * Return a robot's occupancy grid: `data`, `info.width`, `info.resolution` and `info.origin` of a
 * `nav_msgs/OccupancyGrid`, -1 unknown, 0 free … 100 occupied, row by row from the lowest.
 */
export function occupancyGrid(
  cells: Int8Array | readonly number[],
  columns: number,
  resolutionMeters: number,
  { x, y, yaw = 0 }: Origin = { x: 0, y: 0 },
): Source {
  const rows = cells.length / columns;
  if (!Number.isInteger(rows)) {
    const sentence = `${cells.length} cells are no rows of ${columns}; give the number of cells in a row`;
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

/** Return a scene that the server keeps, by its name. */
export function storedScene(name: string): Source {
  return create(SourceSchema, { kind: { case: "storedScene", value: name } });
}

/**
 * Return a map as ROS map_server saves it: the text of the yaml, the bytes of its picture.
 *
 * `objects` is GeoJSON of what its objects are, in metres, where somebody has put them right; they
 * stand for the map where no segmenter is chosen.
 */
export function mapServerMap(yaml: string, image: Uint8Array, objects = ""): Source {
  const value = { yaml, image, objects, ownObjects: objects !== "" };
  return create(SourceSchema, { kind: { case: "mapServerMap", value } });
}

/** Return a picture: PNG, JPEG, WebP, GIF, BMP, TIFF or PGM. */
export function image(data: Uint8Array): Source {
  return create(SourceSchema, { kind: { case: "image", value: { data } } });
}

/** Return a file of another tool; its ending says which. */
export function file(name: string, data: Uint8Array, part = ""): Source {
  return create(SourceSchema, { kind: { case: "file", value: { name, data, part } } });
}

function axis(y: Axis): YAxis {
  if (y === "up") return YAxis.UP;
  if (y === "down") return YAxis.DOWN;
  throw invalid(`y is '${String(y)}'; give 'up', or 'down' for points from a screen`, "y");
}
