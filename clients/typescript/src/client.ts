import type { JsonObject, MessageInitShape } from "@bufbuild/protobuf";
import { type Client, createClient, type Interceptor, type Transport } from "@connectrpc/connect";
import { createConnectTransport } from "@connectrpc/connect-web";

import { invalid, RequestFailed } from "./errors.js";
import { checking } from "./fields.js";
import {
  CatalogService,
  type GetServerInfoResponse,
  type ListAlgorithmsResponse,
} from "./gen/sketchmatch/v1/catalog_service_pb.js";
import type {
  MatchAccepted,
  MatchProgress,
  MatchResult,
  MatchScenes,
} from "./gen/sketchmatch/v1/match_pb.js";
import { type MatchRequestSchema, MatchService } from "./gen/sketchmatch/v1/match_service_pb.js";
import { SceneService, type SegmentResponse } from "./gen/sketchmatch/v1/scene_service_pb.js";
import { SketchService } from "./gen/sketchmatch/v1/sketch_service_pb.js";
import type { Source } from "./gen/sketchmatch/v1/source_pb.js";
import { TransferService } from "./gen/sketchmatch/v1/transfer_service_pb.js";

/** How to get in at a server. */
export interface Access {
  /** Returns the token to show; an empty one is not shown. It is asked for at each call. */
  readonly token?: () => string;
}

/** What else a request says; `MatchRequest` in the contract explains each. */
export type MatchOptions = Omit<
  Extract<MessageInitShape<typeof MatchRequestSchema>, { $typeName?: never }>,
  "sketch" | "map"
>;

/** Called while a match runs, each as often as there is something new. */
export interface MatchWatchers {
  readonly accepted?: (accepted: MatchAccepted) => void;
  readonly scenes?: (scenes: MatchScenes) => void;
  readonly progress?: (progress: MatchProgress) => void;
}

/** What came of a match. Indices of the result point into the scenes. */
export interface Answer {
  readonly scenes: MatchScenes;
  readonly result: MatchResult;
}

/** Asks a server at its address for browsers, as in `http://127.0.0.1:8080`. */
export class SketchmatchClient {
  readonly #address: string;
  readonly #matches: Client<typeof MatchService>;
  readonly #catalog: Client<typeof CatalogService>;
  /** Scenes that the server keeps. Calls of this and the two below throw what `RequestFailed.from` reads. */
  readonly scenes: Client<typeof SceneService>;
  /** Sketches that are matched while they are drawn. */
  readonly sketches: Client<typeof SketchService>;
  /** Carries points, routes and zones from one scene to another. */
  readonly transfers: Client<typeof TransferService>;
  /** Calls any service of the contract, those too that have no method here. */
  readonly transport: Transport;

  /** @throws RequestFailed if the address is none. */
  constructor(address: string, access: Access = {}) {
    if (!/^https?:\/\/[^/]/i.test(address))
      throw invalid(
        `address is '${address}'; give a URL, as in 'http://127.0.0.1:8080'`,
        "address",
      );
    this.#address = address;
    const connect = createConnectTransport({
      baseUrl: address,
      useBinaryFormat: true,
      interceptors: [showing(access.token ?? (() => ""))],
      // A page that is closed still ends its sketch.
      fetch: (input, init) =>
        fetch(input, { ...init, keepalive: String(input).endsWith("/DeleteSketch") }),
    });
    this.transport = checking(connect);
    this.#matches = createClient(MatchService, this.transport);
    this.#catalog = createClient(CatalogService, this.transport);
    this.scenes = createClient(SceneService, this.transport);
    this.sketches = createClient(SketchService, this.transport);
    this.transfers = createClient(TransferService, this.transport);
  }

  /**
   * Find out which sketched object is which mapped object.
   *
   * @throws RequestFailed, with `failure` `"cancelled"` if `signal` aborts it; what a watcher throws
   *   goes through as it is.
   */
  async match(
    sketch: Source,
    map: Source,
    options: MatchOptions = {},
    watchers: MatchWatchers = {},
    signal?: AbortSignal,
  ): Promise<Answer> {
    let scenes: MatchScenes | undefined;
    const request = { ...options, sketch, map };
    for await (const { event } of this.#read(this.#matches.match(request, stopping(signal)))) {
      switch (event.case) {
        case "accepted":
          watchers.accepted?.(event.value);
          break;
        case "scenes":
          scenes = event.value;
          watchers.scenes?.(scenes);
          break;
        case "progress":
          watchers.progress?.(event.value);
          break;
        case "result":
          if (scenes) return { scenes, result: event.value };
      }
    }
    throw new RequestFailed("the server broke off", "away", "", "", undefined);
  }

  /** Find the objects of one source; `includeMap` asks for its occupancy grid, too. */
  async segment(
    source: Source,
    options: {
      segmenter?: { name?: string; parameters?: JsonObject };
      profile?: string;
      includeMap?: boolean;
    } = {},
    signal?: AbortSignal,
  ): Promise<SegmentResponse> {
    return this.#failing(() => this.scenes.segment({ ...options, source }, stopping(signal)));
  }

  /** Return what there is to choose from. */
  async algorithms(signal?: AbortSignal): Promise<ListAlgorithmsResponse> {
    return this.#failing(() => this.#catalog.listAlgorithms({}, stopping(signal)));
  }

  /** Return the server's versions and limits. */
  async info(signal?: AbortSignal): Promise<GetServerInfoResponse> {
    return this.#failing(() => this.#catalog.getServerInfo({}, stopping(signal)));
  }

  /** Yield what a stream holds; what the reader throws meanwhile is none of its faults. */
  async *#read<T>(stream: AsyncIterable<T>): AsyncGenerator<T> {
    try {
      yield* stream;
    } catch (thrown) {
      throw RequestFailed.from(thrown, this.#address);
    }
  }

  async #failing<T>(call: () => Promise<T>): Promise<T> {
    try {
      return await call();
    } catch (thrown) {
      throw RequestFailed.from(thrown, this.#address);
    }
  }
}

function showing(token: () => string): Interceptor {
  return (next) => (request) => {
    const shown = told(token);
    if (shown) request.header.set("Authorization", `Bearer ${shown}`);
    return next(request);
  };
}

/** Return the token; one that cannot be had or sent is not the server's fault. */
function told(token: () => string): string {
  let shown: string;
  try {
    shown = token().trim();
  } catch (thrown) {
    const why = thrown instanceof Error ? thrown.message : String(thrown);
    throw invalid(`token cannot be had (${why}); give a function that returns it`, "token");
  }
  // What it is instead is not told: it may be a secret all the same.
  if (!/^[!-~]*$/.test(shown))
    throw invalid("token is not a token; give what `sketchmatch tokens add` printed", "token");
  return shown;
}

function stopping(signal: AbortSignal | undefined): { signal?: AbortSignal } {
  return signal ? { signal } : {};
}
