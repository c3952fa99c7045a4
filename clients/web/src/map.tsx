/** The robot's side: its map, the things on it, and the route as it would drive. */

import { signal } from "@preact/signals";
import { useEffect, useMemo } from "preact/hooks";

import type { Carried } from "./carry";
import { colourOf } from "./colours";
import { type Box, boxOf, distance, toScreen, type View, type Xy, zoomed } from "./geometry";
import { boxOfMap, droppedFiles, type Thing, type Underlay } from "./maps";
import { toggled } from "./mending";
import { useSize, useView } from "./pane";
import { placed, type Signed, type Signs, widthOf } from "./signs";
import { Badge } from "./sketch";
import {
  answered,
  asking,
  bringMap,
  carried,
  dark,
  isLit,
  lit,
  mapName,
  mending,
  nameOfCarried,
  pairOf,
  pin,
  place,
  question,
  refit,
  sketchName,
} from "./state";
import { texts } from "./texts";

export const ARROW = "M-9,-7L3,0L-9,7";

const over = signal(false);

/** A picture as it is shown, painted anew for light and dark. */
interface Painting {
  readonly picture: Blob | null;
  readonly width: number;
  readonly height: number;
}

const painted = signal<(Painting & { readonly url: string }) | null>(null);

export function MapPane() {
  const { element, size } = useSize<HTMLDivElement>();
  const map = place.value;
  const view = useView(size, () => flippedBox(), 44);
  const t = texts.value;
  const { scale, x, y } = view.value;
  const numbered = map?.things.map((_, k) => !!numberOf(k)) ?? [];
  // Where they stand beside each other is the same wherever the map is moved to.
  const signs = useMemo(
    () => placed(signedOf(map?.things ?? [], numbered, { scale, x: 0, y: 0 })),
    [map?.things, numbered.join(), scale],
  );

  useEffect(() => {
    let wanted = true;
    const underlay = map?.underlay;
    if (!underlay) painted.value = null;
    else
      void paint(underlay, dark.value).then((done) => {
        const url = done.picture ? URL.createObjectURL(done.picture) : "";
        if (wanted) {
          painted.value = { ...done, url };
          if (!map.things.length) refit.value++; // the picture is all that there is to see
        } else URL.revokeObjectURL(url);
      });
    return () => {
      wanted = false;
      if (painted.peek()) URL.revokeObjectURL(painted.peek()?.url ?? "");
    };
  }, [map?.underlay, dark.value]);
  useEffect(() => {
    if (element.current) moved(element.current, view);
  }, []);

  const drop = (event: DragEvent) => {
    event.preventDefault();
    over.value = false;
    if (event.dataTransfer?.files.length) void bringMap(droppedFiles(event.dataTransfer));
  };
  return (
    <div
      ref={element}
      class={`floor${over.value ? " over" : ""}${asking.value !== null || mending.value ? " asking" : ""}`}
      data-testid="map"
      onDragOver={(event) => {
        event.preventDefault();
        over.value = true;
      }}
      onDragLeave={() => (over.value = false)}
      onDrop={drop}
    >
      <svg class="overlay" role="img" aria-label={`${t.map}: ${t.things(map?.things.length ?? 0)}`}>
        {map?.underlay && painted.value && (
          <image
            href={painted.value.url}
            width={painted.value.width}
            height={painted.value.height}
            transform={`${matrix(view.value)} ${placing(map.underlay, painted.value.height)}`}
            class={map.underlay.grid ? "grid" : "photo"}
          />
        )}
        {carried.value.map((way) => (
          <Way key={way.id} way={way} view={view.value} />
        ))}
        {map?.things.map((thing, k) => (
          <MapThing
            key={thing.id}
            index={k}
            view={view.value}
            badge={movedBy(signs[k]?.badge, x, y)}
            label={movedBy(signs[k]?.label, x, y)}
          />
        ))}
      </svg>
    </div>
  );
}

/** Return the number that a thing of the map has by its pair, or 0. */
function numberOf(index: number): number {
  const pair = answered.value ? pairOf({ side: "map", index }) : undefined;
  return pair ? pair.sketch + 1 : 0;
}

/** Return what the things of a map want to be told by. */
export function signedOf(
  things: readonly Thing[],
  numbered: readonly boolean[],
  view: View,
): Signed[] {
  return things.map(({ rings, centroid, label }, k) => ({
    outline: (rings[0] ?? []).map((point) => shown(view, point)),
    centre: shown(view, centroid),
    numbered: numbered[k] ?? false,
    nameWidth: label ? widthOf(label) : 0,
  }));
}

function movedBy(place: Xy | null | undefined, x: number, y: number): Xy | null {
  return place ? [place[0] + x, place[1] + y] : null;
}

function MapThing({ index, view, badge, label }: { index: number; view: View } & Signs) {
  const thing = place.value?.things[index];
  if (!thing) return null;
  const pair = answered.value ? pairOf({ side: "map", index }) : undefined;
  const candidate = asking.value === null && question.value?.candidates.includes(index);
  const d = thing.rings.map((ring) => pathThrough(ring, view)).join("");
  const colour = pair ? colourOf(pair.sketch) : null;
  const state = `${isLit("map", index) ? " lit" : ""}${pair ? "" : " alone"}${candidate ? " candidate" : ""}${mending.value?.has(index) ? " chosen" : ""}`;
  const tapped = () => {
    if (mending.value) {
      mending.value = toggled(mending.value, index);
      return;
    }
    const asked = asking.value ?? (candidate ? (question.value?.sketch ?? null) : null);
    if (asked !== null) pin(asked, index);
    else lit.value = { side: "map", index };
  };
  return (
    <g
      class={`thing${state}`}
      data-testid={`map-thing-${index}`}
      onPointerEnter={() => (lit.value = { side: "map", index })}
      onPointerLeave={() => (lit.value = null)}
      onClick={tapped}
    >
      <title>{texts.value.objectOnMap(mapName(index), pair ? sketchName(pair.sketch) : "")}</title>
      <path d={d} fill={colour ?? "currentColor"} stroke={colour ?? "currentColor"} />
      {pair && badge && <Badge at={badge} number={pair.sketch + 1} colour={colour} />}
      {label && (
        <text class="label" x={label[0]} y={label[1]} text-anchor="middle">
          {thing.label}
        </text>
      )}
    </g>
  );
}

/** A route or a zone, and beneath it a band as wide as what it may be off by. */
function Way({ way, view }: { way: Carried; view: View }) {
  const name = nameOfCarried(way);
  const lines = way.lines.map(({ points }) => points.map((point) => shown(view, point)));
  return (
    <g class={`way ${way.kind}`} data-testid={way.kind}>
      <title>{texts.value.withBand(name)}</title>
      <Band way={way} view={view} />
      {lines.map((points, k) =>
        way.kind === "zone" ? (
          <polygon key={k} points={listed(points)} />
        ) : (
          <g key={k}>
            <polyline points={listed(points)} />
            <Arrow points={points} />
          </g>
        ),
      )}
    </g>
  );
}

function Band({ way, view }: { way: Carried; view: View }) {
  return (
    <g class="band">
      {way.lines.flatMap(({ points, deviations }, line) => {
        const closed = way.kind === "zone" ? points : points.slice(0, -1);
        return closed.map((point, k) => {
          const next = points[(k + 1) % points.length] ?? point;
          const after = deviations[(k + 1) % points.length] ?? 0;
          const [[x1, y1], [x2, y2]] = [shown(view, point), shown(view, next)];
          const width = view.scale * ((deviations[k] ?? 0) + after);
          return <line key={`${line}-${k}`} {...{ x1, y1, x2, y2 }} stroke-width={width} />;
        });
      })}
    </g>
  );
}

function Arrow({ points }: { points: readonly Xy[] }) {
  const at = arrowOf(points);
  return at && <path d={ARROW} transform={at} />;
}

export function listed(points: readonly Xy[]): string {
  return points.map((point) => point.map((n) => n.toFixed(1)).join(",")).join(" ");
}

/** Return where a picture lies, in units of the map. */
function boxOfPicture(
  { origin: [x, y, yaw], resolution }: Underlay,
  { width, height }: Painting,
): Box {
  const [u, v] = [resolution * Math.cos(yaw), resolution * Math.sin(yaw)];
  const corner = (i: number, j: number): Xy => [x + i * u - j * v, y + i * v + j * u];
  return boxOf([corner(0, 0), corner(width, 0), corner(width, height), corner(0, height)]);
}

/** The map's y grows up, the screen's down: views are of the map turned over. */
export function flippedBox() {
  const [map, seen] = [place.peek(), painted.peek()];
  const around = map?.underlay && seen ? boxOfPicture(map.underlay, seen) : null;
  const box = map?.things.length ? boxOfMap(map) : around;
  return box && { x0: box.x0, y0: -box.y1, x1: box.x1, y1: -box.y0 };
}

export function shown(view: View, [x, y]: Xy): Xy {
  return toScreen(view, [x, -y]);
}

export function matrix({ scale, x, y }: View): string {
  return `matrix(${scale} 0 0 ${-scale} ${x} ${y})`;
}

/** Return what takes pixels of a picture to units of the map. */
export function placing({ origin: [x, y, yaw], resolution }: Underlay, height: number): string {
  const turn = (yaw * 180) / Math.PI;
  return `translate(${x} ${y}) rotate(${turn}) scale(${resolution} ${-resolution}) translate(0 ${-height})`;
}

export function pathThrough(ring: readonly Xy[], view: View): string {
  const points = ring.map((point) =>
    shown(view, point)
      .map((n) => n.toFixed(1))
      .join(","),
  );
  return `M${points.join("L")}Z`;
}

/** Return where the arrow at the end of a route is, and how it is turned. */
export function arrowOf(points: readonly Xy[]): string | null {
  const end = points.at(-1);
  // Ink has points so close together that the last two point anywhere.
  const before = end && ([...points].reverse().find((one) => distance(one, end) > 12) ?? points[0]);
  if (!end || !before) return null;
  const turn = (Math.atan2(end[1] - before[1], end[0] - before[0]) * 180) / Math.PI;
  return `translate(${end[0]} ${end[1]}) rotate(${turn})`;
}

/** Walls and floor of an occupancy grid by night and by day, as four bytes of a picture. */
const NIGHT = [pixelOf(214, 208, 196, 225), pixelOf(255, 255, 255, 14)] as const;
const DAY = [pixelOf(58, 66, 76, 225), pixelOf(255, 255, 255, 205)] as const;

function pixelOf(...bytes: readonly [number, number, number, number]): number {
  return new Uint32Array(Uint8Array.from(bytes).buffer)[0] ?? 0;
}

/** Return an occupancy grid in the page's colours, unknown left blank; other pictures as they are. */
export async function paint(underlay: Underlay, night: boolean): Promise<Painting> {
  const bitmap = await createImageBitmap(underlay.pixels);
  const { width, height } = bitmap;
  if (!underlay.grid) return { picture: underlay.pixels, width, height };
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [width, height];
  const context = canvas.getContext("2d", { willReadFrequently: true });
  if (!context) return { picture: null, width, height };
  context.drawImage(bitmap, 0, 0);
  const pixels = context.getImageData(0, 0, width, height);
  const colours = coloursOf(underlay, night);
  const whole = new Uint32Array(pixels.data.buffer);
  for (let k = 0; k < whole.length; k++) {
    // What is transparent is unknown, whatever its grey.
    whole[k] = pixels.data[4 * k + 3] ? (colours[pixels.data[4 * k] ?? 0] ?? 0) : 0;
  }
  context.putImageData(pixels, 0, 0);
  const picture = await new Promise<Blob | null>((done) => canvas.toBlob(done));
  return { picture, width, height };
}

/** Return the colour of each grey of an occupancy grid. */
function coloursOf({ mode, negate }: Underlay, night: boolean): Uint32Array {
  const [wall, floor] = night ? NIGHT : DAY;
  // map_server's grey for unknown is almost free, where greys do not tell how occupied a cell is.
  const free = mode ? 0.25 : 0.1;
  return Uint32Array.from({ length: 256 }, (_, shade) => {
    if (mode === "raw" && shade > 100) return 0;
    const share = mode === "raw" ? shade / 100 : (negate ? shade : 255 - shade) / 255;
    return share > 0.6 ? wall : share < free ? floor : 0;
  });
}

/** Let fingers, the wheel and the mouse move the map. */
function moved(element: HTMLElement, view: { value: View; peek(): View }): void {
  const pointers = new Map<number, Xy>();
  const at = (event: MouseEvent): Xy => {
    const { left, top } = element.getBoundingClientRect();
    return [event.clientX - left, event.clientY - top];
  };
  element.addEventListener("pointerdown", (event) => pointers.set(event.pointerId, at(event)));
  element.addEventListener("pointermove", (event) => {
    const before = pointers.get(event.pointerId);
    if (!before) return;
    const now = at(event);
    pointers.set(event.pointerId, now);
    const other = [...pointers].find(([id]) => id !== event.pointerId)?.[1];
    const seen = view.peek();
    if (other) {
      view.value = zoomed(seen, other, distance(now, other) / Math.max(distance(before, other), 1));
    } else view.value = { ...seen, x: seen.x + now[0] - before[0], y: seen.y + now[1] - before[1] };
  });
  for (const name of ["pointerup", "pointercancel", "pointerleave"] as const) {
    element.addEventListener(name, (event) => pointers.delete(event.pointerId));
  }
  element.addEventListener(
    "wheel",
    (event) => {
      event.preventDefault();
      const seen = view.peek();
      if (event.ctrlKey || event.metaKey) {
        view.value = zoomed(seen, at(event), Math.exp(-event.deltaY * 0.01));
      } else view.value = { ...seen, x: seen.x - event.deltaX, y: seen.y - event.deltaY };
    },
    { passive: false },
  );
}
