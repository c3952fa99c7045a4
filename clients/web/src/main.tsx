/** Begins in steps, between which a slow phone answers fingers: what messages look like, then the page. */

import { options, render } from "preact";

const pause = () => new Promise((later) => setTimeout(later));

// What changes between two frames is shown once.
options.debounceRendering = (show) => void requestAnimationFrame(show);

await import("@sketchmatch/client/v1/match");
await pause();
await import("@sketchmatch/client");
await pause();
const { App } = await import("./app");
const { shownAt, start } = await import("./state");
await pause();
const root = document.getElementById("app");
if (root) render(<App />, root);
await pause();
void start();

// What tests and curious people read.
Object.assign(window, { sketchmatchShown: shownAt });
