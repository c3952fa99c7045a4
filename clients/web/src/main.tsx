import { render } from "preact";

import { App } from "./app";
import { latencies, start } from "./state";

const root = document.getElementById("app");
if (root) render(<App />, root);
void start();

// What tests and curious people read: milliseconds from pen up to answer.
Object.assign(window, { sketchmatchLatencies: latencies });
