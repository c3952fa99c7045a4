/**
 * Prints how Lighthouse judges a page on a phone or on a desktop, as JSON: its scores, and what costs.
 *
 * node lighthouse.mjs PROGRAM URL mobile|desktop
 */

import { launch } from "chrome-launcher";
import lighthouse, { desktopConfig } from "lighthouse";

const [program, url, preset] = process.argv.slice(2);
const chrome = await launch({
  chromePath: program,
  chromeFlags: ["--headless=new", "--no-sandbox", "--disable-gpu", "--disable-quic"],
});
try {
  const { lhr } = await lighthouse(
    url,
    { port: chrome.port, onlyCategories: ["performance", "accessibility"], logLevel: "error" },
    preset === "desktop" ? desktopConfig : undefined,
  );
  const { performance, accessibility } = lhr.categories;
  const costing = [...performance.auditRefs, ...accessibility.auditRefs]
    .filter(({ id, weight }) => weight && (lhr.audits[id].score ?? 1) < 1)
    .map(({ id }) => `${id}: ${lhr.audits[id].displayValue ?? lhr.audits[id].title}`);
  const [fast, open] = [performance, accessibility].map(({ score }) => Math.round(100 * score));
  console.log(JSON.stringify({ performance: fast, accessibility: open, costing }));
} finally {
  chrome.kill();
}
