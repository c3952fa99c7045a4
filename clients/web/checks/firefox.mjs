/**
 * Draws in Firefox, and prints what the pad makes of it before and after a reload, as JSON.
 *
 * node firefox.mjs PROGRAM URL PLACE < lines.json
 *
 * Each line is a list of points in pixels from the middle of the paper.
 */

import { json } from "node:stream/consumers";
import puppeteer from "puppeteer-core";

const [program, url, place] = process.argv.slice(2);
const lines = await json(process.stdin);
const PATIENCE_MS = 60_000;

const browser = await puppeteer.launch({
  browser: "firefox",
  executablePath: program,
  headless: true,
  protocolTimeout: PATIENCE_MS,
  timeout: PATIENCE_MS,
});
try {
  const page = await browser.newPage();
  page.setDefaultTimeout(PATIENCE_MS);
  const faults = [];
  page.on("pageerror", (error) => faults.push(String(error)));
  page.on("console", (said) => said.type() === "error" && faults.push(said.text()));
  await page.setViewport({ width: 1280, height: 860 });
  await page.goto(url);
  await page.waitForSelector("[data-testid=map-thing-0]");
  await page.click("[data-testid=open-places]");
  await page.waitForSelector(`[data-testid=place-${place}]`, { visible: true });
  await page.click(`[data-testid=place-${place}]`);
  await page.waitForSelector(`[data-testid=place-${place}][aria-pressed=true]`);

  const paper = await (await page.waitForSelector("[data-testid=paper]")).boundingBox();
  const [mx, my] = [paper.x + paper.width / 2, paper.y + paper.height / 2];
  for (const [[x, y], ...rest] of lines) {
    await page.mouse.move(mx + x, my + y);
    await page.mouse.down();
    for (const [px, py] of rest) await page.mouse.move(mx + px, my + py, { steps: 6 });
    await page.mouse.up();
  }
  const drawn = await answer(page, lines.length);
  await page.reload();
  const reloaded = await answer(page, lines.length);
  console.log(JSON.stringify({ drawn, reloaded, faults }));
} finally {
  await browser.close();
}

/** Return the name on the map by the number of each sketched thing, once there are so many. */
async function answer(page, things) {
  const all = `[data-testid=pairs] .pair:nth-child(${things})`;
  await page.waitForSelector(all);
  return page.evaluate(() =>
    Object.fromEntries(
      [...document.querySelectorAll("[data-testid=pairs] .line")].map((line) =>
        [".dot", ".partner"].map((part) => line.querySelector(part).textContent),
      ),
    ),
  );
}
