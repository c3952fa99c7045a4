/** Refuses what a message has no field for, and would be left out in silence. */

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

/** Return a transport that looks through each request before it goes out. */
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

/** Refuse what a message, or one in it, has no field for; `path` leads to it. */
function check(schema: DescMessage, given: unknown, path = ""): void {
  // What `sources` made has no other names, and perhaps a million points.
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
  // A Float64Array is as good where numbers are wanted.
  else if (!ArrayBuffer.isView(given)) throw invalid(`${path} is no list; give [ … ]`, path);
}

function checkOneof(oneof: DescOneof, given: unknown, path: string): void {
  const { case: name, value, ...others } = isObject(given) ? given : { other: given };
  const field = oneof.fields.find(({ localName }) => localName === name);
  if (Object.keys(others).length || !field !== (value === undefined) || (name && !field)) {
    const cases = oneof.fields.map(({ localName }) => `'${localName}'`).join(" or ");
    throw invalid(`${path} is unclear; give { case, value } with the case ${cases}`, path);
  }
  if (field) checkValue(field, value, `${path}.value`);
}

function checkValue(field: DescField, given: unknown, path: string): void {
  // The names in a Struct are the server's.
  if (field.message && field.message.typeName !== "google.protobuf.Struct")
    check(field.message, given, path);
  // Written as it is, "false" would be true.
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

/** Return the name of a message's field that somebody may have meant. */
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

/** Whether so many letters put in, left out or exchanged make one word the other. */
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
