/** The parameters by which things are found on a map, as the server's catalogue describes them. */

import { signal } from "@preact/signals";
import { useEffect } from "preact/hooks";

import { parametersOf } from "./maps";
import { client, findOtherwise, place } from "./state";
import { texts } from "./texts";

/** What is used of a property of a JSON Schema. */
interface Property {
  readonly type?: string;
  readonly title?: string;
  readonly description?: string;
  readonly unit?: string;
  readonly minimum?: number;
  readonly maximum?: number;
  readonly default?: unknown;
  readonly enum?: readonly string[];
}

const schemas = signal<ReadonlyMap<string, Readonly<Record<string, Property>>>>(new Map());
let waiting: ReturnType<typeof setTimeout> | undefined;

export function Tuning() {
  useEffect(() => {
    if (!schemas.peek().size) void load();
  }, []);
  const found = place.value?.found;
  const properties = schemas.value.get(found?.segmenter ?? "");
  if (!found || !properties) return null;
  const change = (name: string, value: number | boolean | string) => {
    clearTimeout(waiting);
    const tuned = { ...parametersOf(found), [name]: value };
    waiting = setTimeout(() => void findOtherwise(tuned), 120);
  };
  return (
    <>
      <h2>{texts.value.tuning}</h2>
      {Object.entries(properties).map(([name, property]) => (
        <Control
          key={name}
          name={name}
          property={property}
          value={found.parameters[name] ?? property.default}
          change={(value) => change(name, value)}
        />
      ))}
    </>
  );
}

function Control(props: {
  name: string;
  property: Property;
  value: unknown;
  change: (value: number | boolean | string) => void;
}) {
  const { name, property, value, change } = props;
  const text = <span class="muted">{property.description}</span>;
  if (property.type === "boolean") {
    return (
      <label class="tuning">
        <span class="row">
          {property.title}
          <input
            type="checkbox"
            name={name}
            checked={value === true}
            onChange={({ currentTarget }) => change(currentTarget.checked)}
          />
        </span>
        {text}
      </label>
    );
  }
  if (property.enum) {
    return (
      <label class="tuning">
        {property.title}
        <select
          name={name}
          value={String(value)}
          onChange={({ currentTarget }) => change(currentTarget.value)}
        >
          {property.enum.map((each) => (
            <option key={each}>{each}</option>
          ))}
        </select>
        {text}
      </label>
    );
  }
  if (typeof value !== "number" || (property.type !== "number" && property.type !== "integer")) {
    return null; // one that is worked out from the map unless somebody knows better
  }
  const usual = typeof property.default === "number" ? property.default : 0;
  // What is allowed reaches much farther than what is of use.
  const most = Math.min(property.maximum ?? Infinity, usual > 0 ? 6 * usual : 1);
  return (
    <label class="tuning">
      <span class="row">
        {property.title}
        <output>
          {Number(value.toFixed(3))} {property.unit ?? ""}
        </output>
      </span>
      <input
        type="range"
        name={name}
        min={property.minimum ?? 0}
        max={most}
        step={property.type === "integer" ? 1 : most / 120}
        value={value}
        onInput={({ currentTarget }) => change(currentTarget.valueAsNumber)}
      />
      {text}
    </label>
  );
}

async function load(): Promise<void> {
  try {
    const { algorithms } = await client.algorithms();
    schemas.value = new Map(
      algorithms
        .filter(({ sourceKinds }) => sourceKinds.length)
        .map(({ name, parametersSchema }) => [
          name,
          (parametersSchema?.["properties"] ?? {}) as unknown as Record<string, Property>,
        ]),
    );
  } catch {
    // The pane tells that the server is away.
  }
}
