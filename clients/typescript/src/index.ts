/** A client of sketchmatch servers, for browsers and Node.js: it speaks Connect. */

export { SketchmatchClient } from "./client.js";
export type { Access, MatchOptions, MatchWatchers, Answer } from "./client.js";
export { RequestFailed } from "./errors.js";
export type { Failure } from "./errors.js";
export * as sources from "./sources.js";
