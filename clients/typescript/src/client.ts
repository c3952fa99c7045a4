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

/** What a server requires of its callers. */
export interface Access {
  /** Returns the token to send, or an empty text for none. It is called before each call. */
  readonly token?: () => string;
}

/** The options of a match; `MatchRequest` in the contract explains each. */
export type MatchOptions = Omit<
  Extract<MessageInitShape<typeof MatchRequestSchema>, { $typeName?: never }>,
  "sketch" | "map"
>;

/** Functions that are called while a match runs, each time there is something new. */
export interface MatchWatchers {
  readonly accepted?: (accepted: MatchAccepted) => void;
  readonly scenes?: (scenes: MatchScenes) => void;
  readonly progress?: (progress: MatchProgress) => void;
}

/** The answer of a match. Indices in the result refer to objects of the scenes. */
export interface Answer {
  readonly scenes: MatchScenes;
  readonly result: MatchResult;
}

/** A client of a server at its address for browsers, such as `http://127.0.0.1:8080`. */
export class SketchmatchClient {
  readonly #address: string;
  readonly #matches: Client<typeof MatchService>;
  readonly #catalog: Client<typeof CatalogService>;
  /**
   * Stored scenes. Pass what calls of this client and of the two below throw to
   * `RequestFailed.from`.
   */
  readonly scenes: Client<typeof SceneService>;
  /** Sketches in progress, which are matched while they are drawn. */
  readonly sketches: Client<typeof SketchService>;
  /** Transfers points, routes and zones from one scene to another. */
  readonly transfers: Client<typeof TransferService>;
  /** The transport, with which a client of any service of the contract can be created. */
  readonly transport: Transport;

  /** @throws RequestFailed if the address is not a URL. */
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
      // A page that is being closed can still delete its sketch.
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
   * Finds which sketched object is which mapped object.
   *
   * @throws RequestFailed, with `failure` `"cancelled"` if `signal` aborts the match. What a watcher
   *   throws is passed on as it is.
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
    const sentence = "the server ended the match without a result; send it again";
    throw new RequestFailed(sentence, "away", "", "", undefined);
  }

  /** Finds the objects of one source; with `includeMap` the answer also has its occupancy grid. */
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

  /** Returns the algorithms, profiles and readers of the server. */
  async algorithms(signal?: AbortSignal): Promise<ListAlgorithmsResponse> {
    return this.#failing(() => this.#catalog.listAlgorithms({}, stopping(signal)));
  }

  /** Returns the versions and limits of the server. */
  async info(signal?: AbortSignal): Promise<GetServerInfoResponse> {
    return this.#failing(() => this.#catalog.getServerInfo({}, stopping(signal)));
  }

  /** Yields what a stream has; errors that the reader of this generator throws are not translated. */
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

/** Returns the token, or throws if it cannot be had or sent. */
function told(token: () => string): string {
  let shown: string;
  try {
    shown = token().trim();
  } catch (thrown) {
    const why = thrown instanceof Error ? thrown.message : String(thrown);
    throw invalid(`token cannot be had (${why}); give a function that returns it`, "token");
  }
  // The error does not quote it: it may be a secret all the same.
  if (!/^[!-~]*$/.test(shown))
    throw invalid("token is not a token; give what `sketchmatch tokens add` printed", "token");
  return shown;
}

function stopping(signal: AbortSignal | undefined): { signal?: AbortSignal } {
  return signal ? { signal } : {};
}
