// Matches a sketch with a map and prints which object is which: node match.mjs ADDRESS [REQUEST]
// REQUEST is a file with a MatchRequest in binary, in place of the example.
import { readFileSync } from "node:fs";

import grpc from "@grpc/grpc-js";
import protoLoader from "@grpc/proto-loader";

const files = [
  "sketchmatch/v1/match_service.proto",
  "google/rpc/status.proto",
  "google/rpc/error_details.proto",
];
const options = {
  includeDirs: [".."],
  keepCase: true, // names as in the .proto files
  defaults: true, // or index 0, an empty list and an empty label would be missing
  longs: String, // a number of JavaScript cannot hold every seed
  enums: String,
};
const { sketchmatch, google } = grpc.loadPackageDefinition(protoLoader.loadSync(files, options));

// A Struct as protobufjs wants it: {directions: 36} alone it drops without a word.
const value = (plain) => {
  if (plain === null) return { nullValue: "NULL_VALUE" };
  if (Array.isArray(plain)) return { listValue: { values: plain.map(value) } };
  if (typeof plain === "object") return { structValue: struct(plain) };
  return { [{ number: "numberValue", string: "stringValue", boolean: "boolValue" }[typeof plain]]: plain };
};
const struct = (plain) => ({
  fields: Object.fromEntries(Object.entries(plain).map(([name, each]) => [name, value(each)])),
});

const box = (label, x, y, width, height) => ({
  label,
  rings: [
    {
      points: [
        { x, y },
        { x: x + width, y },
        { x: x + width, y: y + height },
        { x, y: y + height },
      ],
    },
  ],
});
const example = {
  sketch: {
    polygon_set: {
      polygons: [box("bed", 1, 1, 4, 2), box("desk", 7, 2, 2, 3), box("shelf", 2, 6, 1, 5)],
      y_axis: "Y_AXIS_DOWN", // as on a screen
    },
  },
  map: {
    polygon_set: {
      polygons: [box("table", 14, 12, 4, 6), box("bunk", 2, 16, 8, 4), box("rack", 4, 0, 2, 10)],
    },
  },
  pipeline: { histogram: { parameters: struct({ directions: 36 }) } },
};
const [address, file] = process.argv.slice(2);
if (!address) {
  console.error("usage: node match.mjs ADDRESS [REQUEST]");
  process.exit(2);
}
const request = file ? sketchmatch.v1.MatchRequest.deserialize(readFileSync(file)) : example;
const client = new sketchmatch.v1.MatchService(address, grpc.credentials.createInsecure());
const stream = client.Match(request, { deadline: Date.now() + 60_000 });
stream.on("data", ({ result }) => {
  for (const line of result?.object_matches ?? [])
    console.log(
      `${line.sketch_object} ${line.sketch_label} is ${line.map_object} ${line.map_label}, ` +
        `confidence ${line.confidence.toFixed(3)}`,
    );
});
stream.on("error", (error) => {
  process.exitCode = 1;
  console.log(`error ${error.code}: ${error.details}`);
  for (const bytes of error.metadata.get("grpc-status-details-bin"))
    for (const { type_url, value } of google.rpc.Status.deserialize(bytes).details) {
      const detail = google.rpc[type_url.split(".").pop()].deserialize(value);
      if (detail.reason) console.log("reason", detail.reason);
      for (const violation of detail.field_violations ?? []) console.log("field", violation.field);
      if (detail.retry_delay) console.log(`retry after ${detail.retry_delay.seconds}s`);
    }
});
