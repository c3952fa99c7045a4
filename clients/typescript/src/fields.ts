/** Refuses values for which a message has no field; protobuf would ignore them silently. */

import {
  type DescField,
  type DescMessage,
  type DescOneof,
  isMessage,
  ScalarType,
} from "@bufbuild/protobuf";
import type { Transport } from "@connectrpc/connect";

import { invalid, type RequestFailed } from "./errors.js";
import { SourceSchema } from "./gen/sketchmatch/v1/source_pb.js";

/** Returns a transport that checks each request before it is sent. */
export function checking(transport: Transport): Transport {
  return {
    unary: async (method, signal, timeoutMs, header, input, values) => {
      check(method.input, input);
      return transport.unary(method, signal, timeoutMs, header, input, values);
    },
    stream: (method, signal, timeoutMs, header, input, values) => {
      const requests = checked(method.input, input);
      return transport.stream(method, signal, timeoutMs, header, requests, values);
    },
  };
}

async function* checked<T>(schema: DescMessage, requests: AsyncIterable<T>): AsyncGenerator<T> {
  for await (const request of requests) {
    check(schema, request);
    yield request;
  }
}

/** Refuses names that a message, or one within it, has no field for; `path` leads to it. */
function check(schema: DescMessage, given: unknown, path = ""): void {
  // What `sources` made has no unknown names, but perhaps a million points.
  if (given === undefined || isMessage(given, SourceSchema)) return;
  if (!isObject(given)) throw invalid(`${path} is ${said(given)}; give { ${names(schema)} }`, path);
  for (const [name, value] of Object.entries(given)) {
    const member = schema.members.find(({ localName }) => localName === name);
    const inner = path ? `${path}.${name}` : name;
    if (!member && !OF_PROTOBUF.has(name)) throw unknown(schema, name, path, inner);
    if (member && value !== undefined && value !== null) checkMember(member, value, inner);
  }
}

const OF_PROTOBUF = new Set(["$typeName", "$unknown"]);

function checkMember(member: DescField | DescOneof, given: unknown, path: string): void {
  if (member.kind === "oneof") checkOneof(member, given, path);
  else if (member.fieldKind !== "list") checkValue(member, given, path);
  else if (Array.isArray(given))
    given.forEach((one, index) => checkValue(member, one, `${path}[${index}]`));
  // A Float64Array is accepted as a list of numbers.
  else if (!ArrayBuffer.isView(given)) throw invalid(`${path} is not a list; give [ … ]`, path);
}

function checkOneof(oneof: DescOneof, given: unknown, path: string): void {
  const { case: name, value, ...others } = isObject(given) ? given : { other: given };
  const field = oneof.fields.find(({ localName }) => localName === name);
  if (Object.keys(others).length || !field !== (value === undefined) || (name && !field)) {
    const cases = oneof.fields.map(({ localName }) => `'${localName}'`).join(" or ");
    throw invalid(`${path} is not a choice; give { case, value } with the case ${cases}`, path);
  }
  if (field) checkValue(field, value, `${path}.value`);
}

function checkValue(field: DescField, given: unknown, path: string): void {
  // The server checks the names in a Struct.
  if (field.message && field.message.typeName !== "google.protobuf.Struct")
    check(field.message, given, path);
  // As a boolean, the text "false" would be true.
  if (field.scalar === ScalarType.BOOL && typeof given !== "boolean")
    throw invalid(`${path} is ${said(given)}; give true or false`, path);
}

function unknown(schema: DescMessage, name: string, path: string, inner: string): RequestFailed {
  const oneof = schema.fields.find(({ localName }) => localName === name)?.oneof;
  const near = nearest(name, schema);
  const remedy = oneof
    ? `write ${oneof.localName}: { case: '${name}', value: … }`
    : near
      ? `did you mean '${near}'?`
      : "correct the name";
  return invalid(`${path || schema.name} has no '${name}'; ${remedy}`, inner);
}

/** Returns the name of the field that was probably meant, if there is one. */
function nearest(name: string, schema: DescMessage): string | undefined {
  const names = schema.members.map(({ localName }) => localName);
  for (const edits of [0, 1, 2].filter((edits) => edits <= name.length / 2)) {
    const near = names.find((other) => isNear(plain(name), plain(other), edits));
    if (near) return near;
  }
  return undefined;
}

function plain(name: string): string {
  return name.replaceAll("_", "").toLowerCase();
}

/** Whether at most so many letters inserted, deleted or replaced turn one word into the other. */
function isNear(one: string, other: string, edits: number): boolean {
  if (edits < 0) return false;
  if (!one || !other) return one.length + other.length <= edits;
  const [rest, others] = [one.slice(1), other.slice(1)];
  if (one[0] === other[0]) return isNear(rest, others, edits);
  return [
    [rest, other],
    [one, others],
    [rest, others],
  ].some(([a = "", b = ""]) => isNear(a, b, edits - 1));
}

function names(schema: DescMessage): string {
  return schema.members.map(({ localName }) => localName).join(", ");
}

function said(given: unknown): string {
  return typeof given === "string" ? `'${given}'` : String(given);
}

function isObject(value: unknown): value is Record<string, unknown> {
  return typeof value === "object" && value !== null && !Array.isArray(value);
}
