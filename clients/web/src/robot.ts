/** Routes sent to a robot, through rosbridge: JSON over a WebSocket, as `nav_msgs/Path`. */

import { type Carried, yawAt } from "./carry";

/** Where a route goes. */
export interface Robot {
  /** Of the ROS bridge, one of those that the server names. */
  readonly url: string;
  readonly topic: string;
  /** The frame of the robot's map. */
  readonly frame: string;
}

/** Why a route was not sent: nobody answers there, or what the bridge says. */
export class NotSent extends Error {
  constructor(readonly said: string) {
    super(said);
  }
}

const PATIENCE_MS = 5000;
/** Subscribers find a new publisher within this time, and the bridge says what it refuses. */
const SETTLE_MS = 500;

/** Return the ROS bridges that this page may connect to, as whoever runs the server has said. */
export async function robots(): Promise<readonly string[]> {
  try {
    const listed: unknown = await (await fetch("robots.json")).json();
    return Array.isArray(listed) ? listed.map(String) : [];
  } catch {
    return []; // the pane tells that the server is away
  }
}

/** Return a route as a message of ROS 1 and ROS 2, which say it alike but for the time. */
export function pathMessage({ lines }: Carried, frame: string) {
  // Without a time it is where the map is now.
  const header = { frame_id: frame };
  const points = lines[0]?.points ?? [];
  return {
    header,
    poses: points.map(([x, y], k) => {
      const yaw = yawAt(points, k);
      const orientation = { x: 0, y: 0, z: Math.sin(yaw / 2), w: Math.cos(yaw / 2) };
      return { header, pose: { position: { x, y, z: 0 }, orientation } };
    }),
  };
}

/**
 * Send a route.
 *
 * @throws NotSent
 */
export async function send(route: Carried, { url, topic, frame }: Robot): Promise<void> {
  const socket = await connected(url);
  try {
    const said = refusal(socket);
    const tell = (message: object) => socket.send(JSON.stringify(message));
    tell({ op: "advertise", id: "route", topic, type: "nav_msgs/Path", latch: true });
    await Promise.race([later(SETTLE_MS), said]);
    tell({ op: "publish", id: "route", topic, msg: pathMessage(route, frame) });
    await Promise.race([later(SETTLE_MS), said]);
  } finally {
    socket.close();
  }
}

function connected(url: string): Promise<WebSocket> {
  return new Promise((done, failed) => {
    const socket = new WebSocket(url);
    const patience = setTimeout(() => {
      socket.close();
      failed(new NotSent(""));
    }, PATIENCE_MS);
    socket.onopen = () => {
      clearTimeout(patience);
      done(socket);
    };
    socket.onerror = () => {
      clearTimeout(patience);
      failed(new NotSent(""));
    };
  });
}

/** Fail with what the bridge says is wrong, or once it is gone; never end otherwise. */
function refusal(socket: WebSocket): Promise<never> {
  const refused = new Promise<never>((_, failed) => {
    socket.onmessage = ({ data }) => {
      const said = errorIn(String(data));
      if (said !== null) failed(new NotSent(said));
    };
    socket.onclose = () => failed(new NotSent(""));
  });
  refused.catch(() => undefined); // closed by us, when nobody waits any more
  return refused;
}

/** Return what a bridge says is wrong; null if it says something else. */
function errorIn(data: string): string | null {
  try {
    const told = JSON.parse(data) as { op?: string; level?: string; msg?: string };
    return told.op === "status" && told.level === "error" ? (told.msg ?? "") : null;
  } catch {
    return null;
  }
}

function later(ms: number): Promise<void> {
  return new Promise((done) => setTimeout(done, ms));
}
