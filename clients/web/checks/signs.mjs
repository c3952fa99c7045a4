/**
 * Places the signs of things, and prints the boxes that they take, as JSON.
 *
 * node signs.mjs < scenes.json
 *
 * A scene is a list of things: their corners, middle, whether they have a number, and their name's
 * width.
 */

import { json } from "node:stream/consumers";
import { fileURLToPath } from "node:url";
import { build } from "vite";

const scenes = await json(process.stdin);
const entry = fileURLToPath(new URL("../src/signs.ts", import.meta.url));
const [built] = await build({
  configFile: false,
  logLevel: "error",
  build: { write: false, lib: { entry, formats: ["es"] } },
});
const code = Buffer.from(built.output[0].code).toString("base64");
const { badgeBox, labelBox, placed } = await import(`data:text/javascript;base64,${code}`);

console.log(
  JSON.stringify(
    scenes.map((things) =>
      placed(things).map(({ badge, label }, k) => ({
        badge: badge && badgeBox(badge),
        label: label && labelBox(label, things[k].nameWidth),
      })),
    ),
  ),
);
