import { Code, ConnectError } from "@connectrpc/connect";

import {
  BadRequestSchema,
  ErrorInfoSchema,
  RetryInfoSchema,
} from "./gen/google/rpc/error_details_pb.js";

/**
 * What a program does about a failed call:
 *
 * - `invalid`: the request cannot be answered; correct it, `field` says where.
 * - `busy`: send the same again after `retrySeconds`.
 * - `away`: nobody answers there, or not now; try again later.
 * - `unauthenticated`: the server wants a token, or another one.
 * - `gone`: what the request names is not there, or no more; make it anew.
 * - `late`: the time was too short.
 * - `store`: the server cannot keep things, or not now; tell its operator.
 * - `unsupported`: the server does not know the method; it is older, or another server.
 * - `cancelled`: the caller wanted no answer any more.
 * - `failed`: the server or an algorithm is at fault.
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

/** A call that brought no answer. Its `message` is a sentence for people. */
export class RequestFailed extends Error {
  override readonly name = "RequestFailed";

  constructor(
    message: string,
    /** What to do about it. */
    readonly failure: Failure,
    /** For programs, as in `INVALID_STROKE`; empty where the server gave none. */
    readonly reason: string,
    /** Path of the field at fault, as in `sketch.stroke_set.strokes[3]`; empty where there is none. */
    readonly field: string,
    /** After how many seconds the same request may succeed; undefined where nobody knows. */
    readonly retrySeconds: number | undefined,
  ) {
    super(message);
  }

  /** Return what went wrong with a call, whatever was thrown; `address` is who was asked. */
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

/** Whether the server's transport refused a request, which has no status of its own for that. */
function isTooLarge(error: ConnectError): boolean {
  return error.code === Code.ResourceExhausted && /larger than .*max/.test(error.rawMessage);
}

function tooLarge(address: string): RequestFailed {
  const who = address ? `the server at ${address}` : "the server";
  const message = `the request is larger than ${who} accepts; make it smaller`;
  return new RequestFailed(message, "invalid", "MESSAGE_TOO_LARGE", "", undefined);
}

/** Return the error of a request that cannot be sent as it is. */
export function invalid(message: string, field: string): RequestFailed {
  return new RequestFailed(message, "invalid", "INVALID_FIELD", field, undefined);
}

/** Whether nobody answered, or not to the end: fetch throws a TypeError then, in browsers and in Node.js. */
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

/** Whether a value has no place in its message, which is found out before anything is sent. */
function isUnsendable(error: ConnectError): boolean {
  return error.code === Code.Internal && error.rawMessage.startsWith("serialize ");
}
