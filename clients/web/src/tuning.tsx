/** How things are found on a map: what does it, and by which parameters, as the catalogue has it. */

import { type FileReader as Reader, SourceKind } from "@sketchmatch/client/v1/catalog_service";
import { signal } from "@preact/signals";
import { useEffect } from "preact/hooks";

import { type Chosen, type Found, parametersOf } from "./maps";
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

interface Segmenter {
  readonly name: string;
  readonly summary: string;
  readonly isDefault: boolean;
  readonly sourceKinds: readonly SourceKind[];
  readonly properties: Readonly<Record<string, Property>>;
}

const segmenters = signal<readonly Segmenter[]>([]);
let readers: readonly Reader[] = [];
let waiting: ReturnType<typeof setTimeout> | undefined;

export function Tuning() {
  useEffect(() => {
    if (!segmenters.peek().length) void load();
  }, []);
  const found = place.value?.found;
  if (!found) return null;
  const choices = choicesFor(found);
  const used = choices.find(({ name, isDefault }) =>
    found.segmenter ? name === found.segmenter : isDefault,
  );
  const find = (chosen: Chosen) => {
    clearTimeout(waiting);
    waiting = setTimeout(() => void findOtherwise(chosen), 120);
  };
  const change = (name: string, value: number | boolean | string) => {
    const parameters = { ...parametersOf(found), [name]: value };
    find({ name: used?.name ?? "", parameters });
  };
  return (
    <>
      <h2>{texts.value.tuning}</h2>
      {choices.length > 1 && (
        <fieldset class="segmenters">
          <legend>{texts.value.segmenter}</legend>
          {choices.map(({ name, summary, isDefault }) => (
            <label key={name} class="tuning">
              <span class="row">
                <span>
                  {name} {isDefault && `(${texts.value.usual})`}
                </span>
                <input
                  type="radio"
                  name="segmenter"
                  value={name}
                  checked={name === used?.name}
                  onChange={() => find({ name, parameters: {} })}
                />
              </span>
              <span class="muted">{summary}</span>
            </label>
          ))}
        </fieldset>
      )}
      {Object.entries(used?.properties ?? {}).map(([name, property]) => (
        <Control
          key={`${used?.name} ${name}`}
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

const KINDS = {
  strokeSet: SourceKind.STROKE_SET,
  polygonSet: SourceKind.POLYGON_SET,
  occupancyGrid: SourceKind.OCCUPANCY_GRID,
  mapServerMap: SourceKind.MAP_SERVER_MAP,
  image: SourceKind.IMAGE,
} as const;

/** Return the segmenters that read what a map was found in. */
function choicesFor({ source: { kind }, segmenter }: Found): readonly Segmenter[] {
  const all = segmenters.value;
  const isKnown = kind.case !== undefined && kind.case !== "file" && kind.case !== "storedScene";
  const form = isKnown ? KINDS[kind.case] : formOfFile(kind.case === "file" ? kind.value.name : "");
  const forms = form ? [form] : all.find(({ name }) => name === segmenter)?.sourceKinds;
  // What a file holds may be known to the server alone, which then refuses what does not read it.
  return forms
    ? all.filter(({ sourceKinds }) => sourceKinds.some((each) => forms.includes(each)))
    : all;
}

function formOfFile(name: string): SourceKind | undefined {
  const isOf = (suffix: string) => name.toLowerCase().endsWith(suffix);
  if ([".png", ".jpg", ".jpeg", ".bmp", ".pgm"].some(isOf)) return SourceKind.IMAGE;
  return readers.find(({ suffixes }) => suffixes.some(isOf))?.sourceKind;
}

async function load(): Promise<void> {
  try {
    const catalogue = await client.algorithms();
    readers = catalogue.readers;
    segmenters.value = catalogue.algorithms
      .filter(({ sourceKinds }) => sourceKinds.length)
      .map(({ parametersSchema, ...rest }) => ({
        ...rest,
        properties: (parametersSchema?.["properties"] ?? {}) as unknown as Segmenter["properties"],
      }));
  } catch {
    // The pane tells that the server is away.
  }
}
