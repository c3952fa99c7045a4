import { readFileSync } from "node:fs";

import grpc from "@grpc/grpc-js";
import protoLoader from "@grpc/proto-loader";

const options = { includeDirs: [".."], keepCase: true, defaults: true, enums: String, longs: String };
const contract = protoLoader.loadSync("sketchmatch/v1/match_service.proto", options);
const { v1 } = grpc.loadPackageDefinition(contract).sketchmatch;
const client = new v1.MatchService("localhost:50051", grpc.credentials.createInsecure());
const sketch = { file: { name: "sketch.svg", data: readFileSync("sketch.svg") } };
const [yaml, image] = [readFileSync("room.yaml", "utf8"), readFileSync("room.pgm")];
const stream = client.Match({ sketch, map: { map_server_map: { yaml, image } } });
stream.on("data", ({ result }) => {
  for (const line of result?.object_matches ?? [])
    console.log(line.sketch_label, "is object", line.map_object);
});
stream.on("error", (error) => console.error(error.details));
