import { Code, ConnectError } from "@connectrpc/connect";

import {
  BadRequestSchema,
  ErrorInfoSchema,
  RetryInfoSchema,
} from "./gen/google/rpc/error_details_pb.js";

/**
 * What a program can do about a failed call:
 *
 * - `invalid`: the request is wrong; correct it. `field` says where.
 * - `busy`: the server is busy; send the same request again after `retrySeconds`.
 * - `away`: the server does not answer; try again later.
 * - `unauthenticated`: the server requires a token, or another one.
 * - `gone`: what the request names does not exist, or no longer; create it again.
 * - `late`: the time limit was too short; allow more time.
 * - `store`: the server cannot store anything at present; tell its operator.
 * - `unsupported`: the server does not know the method; it is older, or another kind of server.
 * - `cancelled`: the caller cancelled the call.
 * - `failed`: the server or an algorithm failed.
 */
export type Failure =
  | "invalid"
  | "busy"
  | "away"
  | "unauthenticated"
  | "gone"
  | "late"
  | "store"
  | "unsupported"
  | "cancelled"
  | "failed";

const FAILURES: Partial<Record<Code, Failure>> = {
  [Code.InvalidArgument]: "invalid",
  [Code.ResourceExhausted]: "busy",
  [Code.Unavailable]: "away",
  [Code.Unauthenticated]: "unauthenticated",
  [Code.PermissionDenied]: "unauthenticated",
  [Code.NotFound]: "gone",
  [Code.DeadlineExceeded]: "late",
  [Code.FailedPrecondition]: "store",
  [Code.Unimplemented]: "unsupported",
  [Code.Canceled]: "cancelled",
};

/** The error of a call without an answer. Its `message` is a sentence for people. */
export class RequestFailed extends Error {
  override readonly name = "RequestFailed";

  constructor(
    message: string,
    /** What a program can do about it. */
    readonly failure: Failure,
    /** The reason for programs, such as `INVALID_STROKE`; empty if the server gave none. */
    readonly reason: string,
    /** Path of the wrong field, such as `sketch.stroke_set.strokes[3]`; empty if there is none. */
    readonly field: string,
    /** Seconds after which the same request may succeed; undefined if this is not known. */
    readonly retrySeconds: number | undefined,
  ) {
    super(message);
  }

  /** Returns the error of a call, whatever it threw; `address` is that of the server. */
  static from(thrown: unknown, address = ""): RequestFailed {
    if (thrown instanceof RequestFailed) return thrown;
    const error = ConnectError.from(thrown);
    if (error.cause instanceof RequestFailed) return error.cause;
    if (isUnreachable(error)) return unreachable(error, address);
    if (isUnsendable(error))
      return invalid(`the request cannot be sent (${error.rawMessage}); correct it`, "");
    const [info] = error.findDetails(ErrorInfoSchema);
    const [request] = error.findDetails(BadRequestSchema);
    if (!info && isTooLarge(error)) return tooLarge(address);
    const [retry] = error.findDetails(RetryInfoSchema);
    const delay = retry?.retryDelay;
    return new RequestFailed(
      error.rawMessage,
      FAILURES[error.code] ?? "failed",
      info?.reason ?? "",
      request?.fieldViolations[0]?.field ?? "",
      delay && Number(delay.seconds) + delay.nanos / 1e9,
    );
  }
}

/** Whether the server's transport refused a request as too large; it has no own status for that. */
function isTooLarge(error: ConnectError): boolean {
  return error.code === Code.ResourceExhausted && /larger than .*max/.test(error.rawMessage);
}

function tooLarge(address: string): RequestFailed {
  const who = address ? `the server at ${address}` : "the server";
  const message = `the request is larger than ${who} accepts; make it smaller`;
  return new RequestFailed(message, "invalid", "MESSAGE_TOO_LARGE", "", undefined);
}

/** Returns the error of a request that cannot be sent as it is. */
export function invalid(message: string, field: string): RequestFailed {
  return new RequestFailed(message, "invalid", "INVALID_FIELD", field, undefined);
}

/** Whether the server did not answer, or not to the end: fetch then throws a TypeError. */
function isUnreachable(error: ConnectError): boolean {
  return error.code === Code.Unknown && error.cause instanceof TypeError;
}

function unreachable(error: ConnectError, address: string): RequestFailed {
  // In Node.js the cause of the cause says more than "fetch failed".
  const { message, cause } = error.cause as TypeError;
  const deeper = cause instanceof Error ? cause.message || (cause as { code?: string }).code : "";
  const who = address ? `the sketchmatch server at ${address}` : "the sketchmatch server";
  return new RequestFailed(
    `${who} is not available; start it with --web, or check the address (${(deeper || message).trim()})`,
    "away",
    "",
    "",
    undefined,
  );
}

/** Whether a value does not fit its field, which is found before anything is sent. */
function isUnsendable(error: ConnectError): boolean {
  return error.code === Code.Internal && error.rawMessage.startsWith("serialize ");
}
